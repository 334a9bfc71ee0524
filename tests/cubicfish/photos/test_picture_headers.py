"""What pictures claim: small files that claim huge ones take no memory."""

import os
import struct
import subprocess
import sys
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish.errors import PhotoError
from cubicfish.photos import photos
from cubicfish.photos.photos import as_stored, is_picture, is_whole, other_kind, read_size

RNG = np.random.default_rng(0)
COLOUR = cv2.GaussianBlur(RNG.integers(0, 255, (48, 64, 3)).astype(np.uint8), (0, 0), 3)


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(width, height, depth=8, colour=2):
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IEND", b"")


def tiff(entries, *, order="<", big=False):
    word, head = ("Q", 16) if big else ("I", 8)
    start = b"II" if order == "<" else b"MM"
    data = start + struct.pack(order + "H", 43 if big else 42)
    data += struct.pack(order + "HHQ", 8, 0, head) if big else struct.pack(order + "I", head)
    data += struct.pack(order + ("Q" if big else "H"), len(entries))
    for tag, kind, value in entries:
        size = {1: "B", 3: "H", 4: "I", 16: "Q"}[kind]
        field = struct.pack(order + size, value).ljust(8 if big else 4, b"\0")
        data += struct.pack(order + "HH" + word, tag, kind, 1) + field
    return data + bytes(8)


def jpeg(width, height, marker=0xC0, shares=(0x22, 0x11, 0x11)):
    frame = struct.pack(">BHHB", 8, height, width, len(shares))
    frame += b"".join(bytes([i, share, 0]) for i, share in enumerate(shares))
    scan = b"\xff\xda" + struct.pack(">HBBBBBB", 8, 1, 0, 0, 0, 63, 0) + b"data"
    return (
        b"\xff\xd8\xff"
        + bytes([marker])
        + struct.pack(">H", len(frame) + 2)
        + frame
        + (scan + b"\xff\xd9")
    )


def webp(*chunks):
    body = b"".join(kind + struct.pack("<I", len(data)) + data for kind, data in chunks)
    return b"RIFF" + struct.pack("<I", len(body) + 4) + b"WEBP" + body


def canvas(width, height, kind=b"VP8X", before=4):
    return kind, bytes(before) + (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(
        3, "little"
    ) + bytes(10)


def bmp(width, height):
    return b"BM" + bytes(12) + struct.pack("<Iii", 40, width, height) + bytes(30)


HUGE = {
    "png": png(60_000, 60_000),
    "png-16-bit": png(14_000, 14_000, 16, 6),
    "jpeg": jpeg(60_000, 60_000),
    "jpeg-progressive": jpeg(14_100, 14_100, 0xC2, (0x11, 0x11, 0x11)),
    "tiff": tiff([(256, 3, 60_000), (257, 4, 60_000)]),
    "tiff-motorola": tiff([(256, 3, 60_000), (257, 4, 60_000)], order=">"),
    "tiff-twice": tiff([(256, 3, 60_000), (256, 3, 6), (257, 3, 60_000), (257, 3, 6)]),
    "tiff-tile": tiff([(256, 3, 64), (257, 3, 64), (322, 4, 40_000), (323, 4, 40_000)]),
    "tiff-samples": tiff([(256, 3, 4000), (257, 3, 4000), (277, 3, 60_000)]),
    "tiff-bits": tiff([(256, 3, 14_000), (257, 3, 14_000), (258, 3, 64)]),
    "bigtiff": tiff([(256, 16, 60_000), (257, 4, 60_000)], big=True),
    "bigtiff-motorola": tiff([(256, 4, 60_000), (257, 16, 2**40)], order=">", big=True),
    "bmp": bmp(60_000, 60_000),
    "bmp-top-down": bmp(60_000, -60_000),
    "bmp-least": bmp(2, -(2**31)),
    "bmp-os2": b"BM" + bytes(12) + struct.pack("<IHH", 12, 60_000, 60_000),
    "webp-canvas": webp(canvas(60_000, 60_000)),
    "webp-frame": webp(canvas(9, 9), canvas(60_000, 60_000, b"ANMF", 6)),
    "webp-lossless": webp((b"VP8L", b"\x2f" + struct.pack("<I", 0xFFFFFFF) + b"\0")),
    "webp-lossy": webp((b"VP8 ", bytes(3) + b"\x9d\x01\x2a" + struct.pack("<HH", 16383, 16383))),
}


@pytest.mark.parametrize("data", [HUGE["png"], HUGE["jpeg"]], ids=["png", "jpeg"])
def test_huge_claims_never_reach_a_decoder(tmp_path, monkeypatch, data):
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    path = tmp_path / "photo"
    path.write_bytes(data)
    for read in (photos.read_picture, lambda path: photos.PictureFile.read(path).size):
        with pytest.raises(PhotoError, match=r"claims more than the 200 million pixels allowed"):
            read(path)


READ_ALL = """
import resource, sys
from pathlib import Path
from cubicfish.photos import photos
from cubicfish.errors import PhotoError
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        photos.read_picture(path)
    except PhotoError as refused:
        print(path.name, "too large" if "claims more" in str(refused) else "damaged")
print("MB", (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="memory is measured as Unix does")
def test_small_files_that_claim_much_take_no_memory(tmp_path):
    whole = {
        suffix: cv2.imencode(f".{suffix}", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
        for suffix in ("bmp", "ppm")
    }
    side = struct.pack("<ii", 30_000, 30_000)
    files = {
        **HUGE,
        "bmp-else-whole": whole["bmp"][:18] + side + whole["bmp"][26:],
        "ppm-else-whole": whole["ppm"].replace(b"8 8", b"30000 30000"),
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    # OpenCV takes the bound of cubicfish.photos.photos when it is loaded, as the program sets it.
    environment = {**os.environ, "OPENCV_IO_MAX_IMAGE_PIXELS": "200000000"}
    reported = subprocess.run(
        [sys.executable, "-c", READ_ALL, tmp_path],
        check=True, capture_output=True, text=True, env=environment,
    ).stdout.splitlines()  # fmt: skip
    refused = dict(line.rsplit(" ", 1) if "damaged" in line else line.split(" ", 1)
                   for line in reported)  # fmt: skip
    assert int(refused.pop("MB")) < 100
    assert refused.keys() == files.keys()
    assert refused["bmp-else-whole"] == refused["ppm-else-whole"] == "too large"


DAMAGED = {
    "jpeg-without-end": jpeg(640, 480)[:-2],
    "jpeg-without-scan": b"\xff\xd8\xff\xe0\0\x02\xff\xd9",
}


@pytest.mark.parametrize("data", DAMAGED.values(), ids=DAMAGED)
def test_half_a_jpeg_never_reaches_a_decoder(tmp_path, monkeypatch, data):
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    path = tmp_path / "photo"
    path.write_bytes(data)
    with pytest.raises(PhotoError, match="cut short or damaged"):
        photos.read_picture(path)


@pytest.mark.parametrize(
    "data",
    [b"GIF89a\x60\xea\x60\xea", b"v/1\x01", b"#?RADIANCE\n\n-Y 9 +X 9\n", b"P7\nWIDTH 9\n",
     b"\x59\xa6\x6a\x95", b"Pf\n9 9\n-1\n", b"\0\0\0\x20ftypavif", b"8BPS"],
)  # fmt: skip
def test_kinds_whose_headers_are_not_read_never_reach_a_decoder(tmp_path, monkeypatch, data):
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    assert not is_picture(data)
    (tmp_path / "photo").write_bytes(data + bytes(100))
    with pytest.raises(PhotoError, match="save it as PNG"):
        photos.read_picture(tmp_path / "photo")


@pytest.mark.parametrize(
    ("name", "data", "kind"),
    [
        ("a.heic", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "a HEIC picture"),
        ("a.jpg", b"\0\0\0\x18ftypmif1\0\0\0\0mif1heic", "a HEIC picture"),
        ("a.avif", b"\0\0\0\x1cftypmif1\0\0\0\0mif1avifmiaf", "an AVIF picture"),
        ("a.mp4", b"\0\0\0\x20ftypisom\0\0\2\0isomiso2avc1mp41", "a video: save frames of it"),
        ("a.mp4", b"\0\0\0\x10ftypisom\0\0\2\0heic", "a video"),  # beyond the brands
        ("a.mov", b"\0\0\0\x08mdat", "a video"),
        ("a.avi", b"RIFF\0\0\0\0AVI LIST", "a video"),
        ("a.mkv", b"\x1a\x45\xdf\xa3", "a video"),
        ("a.CR3", b"\0\0\0\x18ftypcrx \0\0\0\1crx isom", "a camera's raw file: develop it"),
        ("a.cr2", b"II*\0\x10\0\0\0CR\2\0", "a camera's raw file"),
        ("a.NEF", tiff([(256, 3, 160), (257, 3, 120)], order=">"), "a camera's raw file"),
        ("a.raf", b"FUJIFILMCCD-RAW 0201", "a camera's raw file"),
    ],
)
def test_what_is_known_and_not_read_is_named_with_what_to_do(
    tmp_path, monkeypatch, name, data, kind
):
    monkeypatch.setattr(photos, "_READS_PHONES", False)
    (tmp_path / name).write_bytes(data + bytes(100))
    with pytest.raises(PhotoError) as refused:
        photos.read_picture(tmp_path / name)
    assert str(refused.value).startswith(f"{tmp_path / name} is {kind}")
    assert "as PNG or JPEG" in str(refused.value)


@pytest.mark.parametrize("data", [b"", b"RIFF", b"\0\0\0\0ftyp", b"hello", b"\xff\xfe\x0a"])
def test_what_says_little_is_no_puzzle(data):
    assert other_kind(data, ".png") is None or data.endswith(b"ftyp")


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "bmp", "webp", "ppm"])
def test_pictures_that_are_read_are_of_no_other_kind(suffix):
    assert other_kind(cv2.imencode(f".{suffix}", COLOUR)[1].tobytes(), f".{suffix}") is None


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_pictures_claim_what_they_hold(suffix):
    data = cv2.imencode(f".{suffix}", COLOUR)[1].tobytes()
    assert read_size(data) == (64, 48)
    assert is_whole(data)


@pytest.mark.slow
@given(st.sampled_from(sorted({**HUGE, **DAMAGED})), st.data())
def test_any_damage_is_reported_or_has_a_size(kind, data):
    hurt = bytearray({**HUGE, **DAMAGED}[kind])
    for _ in range(data.draw(st.integers(1, 6))):
        hurt[data.draw(st.integers(0, len(hurt) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(hurt[: data.draw(st.integers(0, len(hurt)))])
    assert is_whole(cut) in (False, True)
    assert min(read_size(cut) or (0,)) >= 0


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_a_note_of_orientation_is_undone_in_every_kind_of_tiff(order, big):
    size = [(256, 3, 70), (257, 4, 50)]
    noted, plain = (
        tiff([*size, (274, 3, way), (274, 4, way)], order=order, big=big) for way in (6, 1)
    )
    assert as_stored(noted) == plain
    assert as_stored(plain) is plain


def test_no_note_or_one_of_no_number_changes_nothing():
    note = tiff([(274, 3, 6)])
    afar = note.replace(struct.pack("<HHI", 274, 3, 1), struct.pack("<HHI", 274, 3, 9))
    for data in (tiff([(256, 3, 6)]), afar, note[:14], b"II+\0\x08\0\0\0" + b"\xff" * 16, b""):
        assert as_stored(data) is data


@pytest.mark.parametrize("marker", [0xC4, 0xC8, 0xCC])
def test_tables_before_the_frame_of_a_jpeg_are_no_frame(marker):
    table = bytes([0xFF, marker]) + struct.pack(">H", 19) + bytes(17)
    photo = jpeg(64, 48)
    assert read_size(photo[:2] + table + photo[2:]) == (64, 48)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "L"])
def test_pictures_of_phones_are_read_with_their_extra(tmp_path, mode):
    heif = pytest.importorskip("pillow_heif")
    smooth = cv2.GaussianBlur(cv2.resize(COLOUR, (96, 64)), (0, 0), 5)
    given = smooth if mode == "RGB" else cv2.cvtColor(smooth, getattr(cv2, _OF_MODE[mode]))
    heif.encode(mode, (96, 64), given.tobytes(), tmp_path / "a.heic", quality=100)
    read = photos.read_picture(tmp_path / "a.heic")
    assert photos.PictureFile.read(tmp_path / "a.heic").size == (96, 64)
    order = {"RGB": cv2.COLOR_BGR2RGB, "RGBA": cv2.COLOR_BGRA2RGBA}
    seen = cv2.cvtColor(read, order[mode]) if mode in order else photos.grey(read)
    assert np.abs(seen.astype(int) - given).mean() < 3
    data = (tmp_path / "a.heic").read_bytes()
    (tmp_path / "cut.heic").write_bytes(data[: len(data) // 2])
    with pytest.raises(PhotoError, match="cut short or damaged"):
        photos.read_picture(tmp_path / "cut.heic")


_OF_MODE = {"RGBA": "COLOR_BGR2RGBA", "L": "COLOR_BGR2GRAY"}
