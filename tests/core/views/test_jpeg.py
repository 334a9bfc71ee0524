"""What a JPEG says beside its pixels: read, and passed on."""

import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish_cli.app.undistortion.images import jpeg_nature, with_segments

RNG = np.random.default_rng(4)
COLOUR = cv2.GaussianBlur(RNG.integers(0, 255, (40, 56, 3)).astype(np.uint8), (0, 0), 2)


def encoded(*options: int, picture=COLOUR) -> bytes:
    return cv2.imencode(".jpg", picture, list(options))[1].tobytes()


def exif(order: str = "<", *, orientation: int = 6, thumbnail: bytes = b"") -> bytes:
    """An EXIF segment with an orientation, a GPS directory, and perhaps a thumbnail."""
    make = b"Makers\0"  # longer than four bytes, so it stands apart
    first, gps, text = 8, 8 + 2 + 12 * 3 + 4, 8 + 2 + 12 * 3 + 4 + 2 + 12 + 4
    second = text + len(make)
    p = lambda kind, *values: struct.pack(order + kind, *values)  # noqa: E731
    tiff = (b"II" if order == "<" else b"MM") + p("HI", 42, first)
    tiff += p("H", 3)
    tiff += p("HHII", 0x010F, 2, len(make), text)
    tiff += p("HHIHH", 0x0112, 3, 1, orientation, 0)
    tiff += p("HHII", 0x8825, 4, 1, gps)
    tiff += p("I", second if thumbnail else 0)
    tiff += p("H", 1) + p("HHI4s", 0x0001, 2, 2, b"N\0\0\0") + p("I", 0)
    tiff += make
    if thumbnail:
        tiff += p("H", 1) + p("HHII", 0x0201, 4, 1, second + 18) + p("I", 0) + thumbnail
    body = b"Exif\0\0" + tiff
    return b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body


PROFILE = b"\xff\xe2" + struct.pack(">H", 2 + 12 + 2 + 30) + b"ICC_PROFILE\0\1\1" + bytes(range(30))


@given(st.integers(1, 100))
def test_the_quality_is_found(quality):
    nature = jpeg_nature(encoded(cv2.IMWRITE_JPEG_QUALITY, quality))
    again = jpeg_nature(encoded(*nature.encode_options(None)))
    # The lowest qualities share their tables.
    assert nature.quality == quality or encoded(cv2.IMWRITE_JPEG_QUALITY, quality) == encoded(
        cv2.IMWRITE_JPEG_QUALITY, nature.quality
    )
    assert again == nature


@pytest.mark.parametrize("sampling", [0x111111, 0x211111, 0x221111, 0x411111])
@pytest.mark.parametrize("progressive", [0, 1])
def test_sampling_and_order_are_found(sampling, progressive):
    options = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling]
    options += [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive, cv2.IMWRITE_JPEG_QUALITY, 77]
    nature = jpeg_nature(encoded(*options))
    assert nature.sampling == sampling
    assert nature.progressive == bool(progressive)
    assert encoded(*nature.encode_options(None)) == encoded(*options)
    assert jpeg_nature(encoded(*nature.encode_options(33))).quality == 33


def test_grey_files_have_no_sampling():
    assert jpeg_nature(encoded(picture=COLOUR[..., 0].copy())).sampling is None


@pytest.mark.parametrize("order", ["<", ">"])
def test_exif_and_profile_go_along(order):
    source = with_segments(encoded(), (exif(order), PROFILE))
    nature = jpeg_nature(source)
    assert nature.segments == (exif(order), PROFILE)
    made = with_segments(encoded(cv2.IMWRITE_JPEG_QUALITY, 50), nature.segments)
    assert jpeg_nature(made).segments == nature.segments
    # A reader that turns pictures upright finds the orientation: 6 is a quarter turn.
    assert cv2.imdecode(np.frombuffer(made, np.uint8), cv2.IMREAD_COLOR).shape == (56, 40, 3)
    assert made[:4] == b"\xff\xd8\xff\xe0"


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_old_thumbnail_is_not_found_any_more(order):
    thumbnail = b"\xff\xd8old picture\xff\xd9"
    source = with_segments(encoded(), (exif(order, thumbnail=thumbnail),))
    assert b"old picture" in source
    (segment,) = jpeg_nature(source).segments
    plain = exif(order)
    assert segment[4 : len(plain)] == plain[4:]  # the same, with no way on from its end


def test_what_is_no_jpeg_has_no_nature():
    assert jpeg_nature(b"") is None
    assert jpeg_nature(cv2.imencode(".png", COLOUR)[1].tobytes()) is None


@given(st.data())
def test_damage_is_never_an_error(data):
    source = bytearray(with_segments(encoded(), (exif(thumbnail=b"xxxx"), PROFILE)))
    at = data.draw(st.integers(3, 300))
    source[at] = data.draw(st.integers(0, 255))
    jpeg_nature(bytes(source[: data.draw(st.integers(4, len(source)))]))
