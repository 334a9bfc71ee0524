"""What a JPEG says beside its pixels: read, and passed on."""

import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish_cli.undistortion.images import jpeg_like, with_segments

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


def options_of(data: bytes, quality: int | None = None) -> dict[int, int]:
    options = jpeg_like(data, quality)[0]
    return dict(zip(options[::2], options[1::2], strict=True))


@given(st.integers(1, 100))
def test_the_quality_is_found(quality):
    source = encoded(cv2.IMWRITE_JPEG_QUALITY, quality)
    # The lowest qualities share their tables.
    assert encoded(*jpeg_like(source)[0]) == source


@pytest.mark.parametrize("sampling", [0x111111, 0x211111, 0x221111, 0x411111])
@pytest.mark.parametrize("progressive", [0, 1])
def test_sampling_and_order_are_found(sampling, progressive):
    options = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling]
    options += [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive, cv2.IMWRITE_JPEG_QUALITY, 77]
    source = encoded(*options)
    assert encoded(*jpeg_like(source)[0]) == source
    again = options_of(source, 33)
    assert again[cv2.IMWRITE_JPEG_QUALITY] == 33
    assert again[cv2.IMWRITE_JPEG_SAMPLING_FACTOR] == sampling
    assert (cv2.IMWRITE_JPEG_PROGRESSIVE in again) == bool(progressive)


def test_grey_files_have_no_sampling():
    assert list(options_of(encoded(picture=COLOUR[..., 0].copy()))) == [cv2.IMWRITE_JPEG_QUALITY]


@pytest.mark.parametrize("order", ["<", ">"])
def test_exif_and_profile_go_along(order):
    source = with_segments(encoded(), exif(order) + PROFILE)
    segments = jpeg_like(source)[1]
    assert segments == exif(order) + PROFILE
    made = with_segments(encoded(cv2.IMWRITE_JPEG_QUALITY, 50), segments)
    assert jpeg_like(made)[1] == segments
    # A reader that turns pictures upright finds the orientation: 6 is a quarter turn.
    assert cv2.imdecode(np.frombuffer(made, np.uint8), cv2.IMREAD_COLOR).shape == (56, 40, 3)
    assert made[:4] == b"\xff\xd8\xff\xe0"


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_old_thumbnail_is_not_found_any_more(order):
    thumbnail = b"\xff\xd8old picture\xff\xd9"
    source = with_segments(encoded(), exif(order, thumbnail=thumbnail))
    assert b"old picture" in source
    segment = jpeg_like(source)[1]
    plain = exif(order)
    assert segment[4 : len(plain)] == plain[4:]  # the same, with no way on from its end


def test_what_is_no_jpeg_has_no_nature():
    for data in (b"", cv2.imencode(".png", COLOUR)[1].tobytes()):
        assert jpeg_like(data) == ([cv2.IMWRITE_JPEG_QUALITY, 95], b"")


@given(st.data())
def test_damage_is_never_an_error(data):
    source = bytearray(with_segments(encoded(), exif(thumbnail=b"xxxx") + PROFILE))
    at = data.draw(st.integers(3, 300))
    source[at] = data.draw(st.integers(0, 255))
    jpeg_like(bytes(source[: data.draw(st.integers(4, len(source)))]))
