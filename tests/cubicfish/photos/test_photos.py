import os
import struct
import subprocess
import sys
import zlib
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish.errors import PhotoError
from cubicfish.photos import photos
from cubicfish.photos.photos import (
    Photo,
    PictureFile,
    find_photos,
    grey,
    read_grey,
    read_picture,
)

RNG = np.random.default_rng(0)
COLOUR = cv2.GaussianBlur(RNG.integers(0, 255, (30, 40, 3)).astype(np.uint8), (0, 0), 3)


def make(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), COLOUR) if path.suffix in photos.SUFFIXES else path.write_text("x")


def names(*arguments):
    return [photo.name for photo in find_photos(arguments)]


def test_a_folder_gives_its_photos_in_natural_order(tmp_path):
    make(tmp_path, "img10.png", "img2.png", "IMG1.JPG".lower(), ".hidden.png", "notes.txt")
    make(tmp_path, "below/other.png", "photo.png.txt")
    (tmp_path / "folder.png").mkdir()
    assert names(tmp_path) == ["img1.jpg", "img2.png", "img10.png"]
    assert all(photo.path == tmp_path / photo.name for photo in find_photos([tmp_path]))


def test_files_and_patterns_together_give_each_photo_once(tmp_path, monkeypatch):
    make(tmp_path, "a2.png", "a10.png", "b.jpg", "a3.txt", "below/c.png", ".a1.png")
    monkeypatch.chdir(tmp_path)
    assert names("a*") == ["a2.png", "a10.png"]
    assert names("b.jpg", "a*.png", "a2.png", str(tmp_path)) == ["a2.png", "a10.png", "b.jpg"]
    assert names("**/*.png") == ["a2.png", "a10.png", "c.png"]
    assert names("a3.txt") == ["a3.txt"]
    (tmp_path / "link.png").symlink_to("b.jpg")
    assert names("b.jpg", "link.png") == ["b.jpg"]


def test_a_name_with_brackets_is_a_file_first(tmp_path):
    make(tmp_path, "set[1].png")
    assert names(tmp_path / "set[1].png") == ["set[1].png"]


def test_equal_names_become_paths_below_the_common_folder(tmp_path):
    make(tmp_path, "left/1.png", "left/2.png", "right/1.png")
    assert names(tmp_path / "left", tmp_path / "right") == [
        "left/1.png",
        "left/2.png",
        "right/1.png",
    ]
    make(tmp_path, "1.png")
    assert names(tmp_path, tmp_path / "left/1.png") == ["1.png", "left/1.png"]
    assert names(tmp_path / "left", tmp_path / "right/1.png")[0] == "left/1.png"


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("absent.png", "does not exist"),
        ("", "empty"),
        ("*.png", "matches no photo"),
        ("raw", r"holds no photos, only \.cr2, \.txt: photos are PNG, JPEG"),
        ("none", "holds no photos: photos are"),
        ("a\n\0b", r"a\\n\\x00b does not exist"),
    ],
)
def test_what_is_not_there_is_said(tmp_path, monkeypatch, argument, says):
    make(tmp_path, "raw/a.CR2", "raw/b.txt", "none/.hidden")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(PhotoError, match=says) as caught:
        find_photos([argument])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["line\nbreak.png", " led.png"])
def test_a_name_that_a_table_cannot_hold_is_refused(tmp_path, name):
    make(tmp_path, name)
    with pytest.raises(PhotoError, match="rename") as caught:
        find_photos([tmp_path])
    assert "\n" not in str(caught.value)


@given(st.lists(st.text(alphabet="ab01²٣._", max_size=6)))
def test_any_names_can_be_sorted(texts):
    assert sorted(texts, key=Photo.natural_key) is not None
    assert Photo.natural_key("img2x") < Photo.natural_key("img10x") < Photo.natural_key("imgx")


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_pictures_are_read_as_stored(tmp_path, suffix, dtype, channels):
    picture = RNG.integers(0, np.iinfo(dtype).max, (20, 30, channels)).astype(dtype)
    picture = picture[..., 0] if channels == 1 else picture
    path = tmp_path / f"p{suffix}"
    cv2.imwrite(str(path), picture)
    read = read_picture(path)
    np.testing.assert_array_equal(read, picture)
    assert read.dtype == dtype
    brightness = read_grey(path)
    assert brightness.shape == (20, 30)
    assert brightness.dtype == dtype
    if channels > 1:
        weighed = picture[..., :3] @ np.array([0.114, 0.587, 0.299])
        assert np.abs(brightness - weighed).max() <= np.iinfo(dtype).max / 250


def test_grey_of_one_or_two_channels_is_the_first():
    two = RNG.integers(0, 255, (4, 5, 2)).astype(np.uint8)
    np.testing.assert_array_equal(grey(two), two[..., 0])
    np.testing.assert_array_equal(grey(two[..., :1]), two[..., 0])
    np.testing.assert_array_equal(grey(two[..., 0]), two[..., 0])


def test_an_orientation_noted_in_the_file_is_not_applied(tmp_path):
    jpeg = cv2.imencode(".jpg", COLOUR)[1].tobytes()
    # TIFF header, one entry: tag 0x0112 (orientation), SHORT, 1 value, 6 (a quarter turn).
    tiff = b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHIHHI", 0x0112, 3, 1, 6, 0, 0)
    exif = b"Exif\0\0" + tiff
    path = tmp_path / "turned.jpg"
    path.write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:])
    turned = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert turned.shape == (40, 30, 3)  # the note is there: others obey it
    assert read_picture(path).shape == (30, 40, 3)
    assert read_grey(path).shape == (30, 40)
    assert PictureFile.read(path).size == (40, 30)


@pytest.mark.parametrize("size", [(1300, 700), (5200, 900), (639, 300)])
def test_a_copy_is_made_of_no_more_than_it_needs_and_looks_the_same(tmp_path, size):
    picture = cv2.resize(COLOUR, size, interpolation=cv2.INTER_CUBIC)
    exif = b"Exif\0\0" + b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x0112, 3, 1, 6, 0)
    for suffix in (".jpg", ".png"):
        data = cv2.imencode(suffix, picture)[1].tobytes()
        if suffix == ".jpg":  # a quarter turn is noted, and not made
            data = data[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data[2:]
        whole = PictureFile(path=tmp_path / "a", data=data).picture()
        small = PictureFile(path=tmp_path / "a", data=data).picture(least=640)
        assert whole.shape[:2] == size[::-1]
        longest = max(small.shape[:2])
        assert longest >= min(640, max(size))
        assert longest < (1290 if suffix == ".jpg" else np.inf)
        least = tuple(side * min(640, longest) // longest for side in small.shape[1::-1])
        one, other = (
            cv2.resize(of, least, interpolation=cv2.INTER_AREA).astype(int) for of in (whole, small)
        )
        assert np.abs(one - other).mean() < 1


def with_orientation(data, turned):
    """A little-endian TIFF file whose directory notes an orientation too."""
    start = struct.unpack_from("<I", data, 4)[0]
    entries = [
        data[at : at + 12]
        for at in range(start + 2, start + 2 + 12 * struct.unpack_from("<H", data, start)[0], 12)
    ]
    entries = [one for one in entries if struct.unpack_from("<H", one)[0] != 274]
    entries.append(struct.pack("<HHIHH", 274, 3, 1, turned, 0))
    entries.sort(key=lambda one: struct.unpack_from("<H", one)[0])
    directory = struct.pack("<H", len(entries)) + b"".join(entries) + bytes(4)
    return data[:4] + struct.pack("<I", len(data)) + data[8:] + directory


@pytest.mark.parametrize("turned", range(1, 9))
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(30, 40), (30, 40, 3)])
def test_a_tiff_is_read_as_stored_whatever_its_orientation(tmp_path, shape, dtype, turned):
    picture = RNG.integers(0, np.iinfo(dtype).max, shape).astype(dtype)
    path = tmp_path / "turned.tif"
    path.write_bytes(with_orientation(cv2.imencode(".tif", picture)[1].tobytes(), turned))
    others = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)  # which follow the note
    assert (turned == 1) == np.array_equal(others, picture)
    np.testing.assert_array_equal(read_picture(path), picture)
    assert PictureFile.read(path).size == (40, 30)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm"])
def test_sizes_and_cut_files(tmp_path, suffix):
    path = tmp_path / f"p{suffix}"
    cv2.imwrite(str(path), COLOUR)
    assert PictureFile.read(path).size == (40, 30)
    data = path.read_bytes()
    for share in (0.02, 0.5, 0.9):
        path.write_bytes(data[: max(12, int(len(data) * share))])
        with pytest.raises(PhotoError, match="cut short or damaged"):
            read_picture(path)


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"", "is empty"), (b"hello, I am text", "not a picture"), (b"\xff\xd8\xff", "cut short")],
)
def test_files_that_hold_no_picture(tmp_path, content, says):
    path = tmp_path / "p.png"
    path.write_bytes(content)
    with pytest.raises(PhotoError, match=says):
        read_picture(path)


@pytest.mark.parametrize(
    ("size", "is_copy"),
    [
        ((1920, 1080), True), ((1280, 720), True), ((853, 480), True), ((640, 361), True),
        ((640, 363), False), ((1080, 1920), False), ((1920, 1078), False), ((1440, 1080), False),
    ],
)  # fmt: skip
def test_a_reduced_copy_has_the_shape_of_its_photo(tmp_path, size, is_copy):
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.zeros(size[::-1], np.uint8))
    assert PictureFile.read(path).is_copy_of((1920, 1080)) is is_copy


def test_a_photo_is_read_in_the_size_it_is_brought_to(tmp_path):
    path = tmp_path / "a.png"
    ramp = np.tile(np.arange(0, 240, 2, dtype=np.uint8), (90, 1))
    cv2.imwrite(str(path), ramp)
    for size in ((80, 60), (180, 135), (120, 90)):
        for photo in (Photo(name="a", path=path), Photo(name="a", path=path, picture=ramp)):
            brought = replace(photo, size=size).read_grey()
            assert brought.shape == size[::-1]
            middle = brought[size[1] // 2, 10:-10].astype(float)
            expected = ((np.arange(10, size[0] - 10) + 0.5) * 120 / size[0] - 0.5) * 2
            np.testing.assert_allclose(middle, expected, atol=1)


def test_missing_files_folders_and_pipes(tmp_path):
    with pytest.raises(PhotoError, match="No such file"):
        read_picture(tmp_path / "absent.png")
    with pytest.raises(PhotoError, match="not a file"):
        read_picture(tmp_path)
    if not hasattr(os, "mkfifo"):
        return
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(PhotoError, match="not a file"):
        PictureFile.read(tmp_path / "pipe.png")


def test_floating_point_pictures_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "f.tif"), COLOUR.astype(np.float32))
    with pytest.raises(PhotoError, match=r"float32.*8 or 16 bits"):
        read_picture(tmp_path / "f.tif")


def test_a_small_file_that_claims_a_huge_picture_is_refused(tmp_path):
    header = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)

    def chunk(kind, body):
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    path = tmp_path / "bomb.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IEND", b""))
    with pytest.raises(PhotoError, match="200 million pixels"):
        read_picture(path)


@pytest.mark.slow
def test_decoders_write_nothing_to_stderr(tmp_path):
    png = cv2.imencode(".png", COLOUR)[1].tobytes()
    (tmp_path / "cut.png").write_bytes(png[: len(png) // 2])
    big = cv2.resize(COLOUR, (640, 480), interpolation=cv2.INTER_NEAREST)
    jpeg = bytearray(cv2.imencode(".jpg", big)[1].tobytes())
    jpeg[len(jpeg) // 2 : len(jpeg) // 2 + 40] = bytes(40)
    (tmp_path / "hurt.jpg").write_bytes(bytes(jpeg))
    code = (
        "import sys; from pathlib import Path\n"
        "from cubicfish.photos.photos import read_picture\n"
        "try: read_picture(Path(sys.argv[1]))\n"
        "except OSError: pass\n"
        "read_picture(Path(sys.argv[2])); print('still here', file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, tmp_path / "cut.png", tmp_path / "hurt.jpg"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == "still here\n"
    command = (
        f"exec 2>&-; exec {sys.executable} -c 'from pathlib import Path; "
        f"from cubicfish.photos.photos import read_picture; "
        f'print(read_picture(Path("{tmp_path}/hurt.jpg")).shape)\''
    )
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout == "(480, 640, 3)\n"


@pytest.mark.parametrize("kind", [b"P2", b"P3", b"P5", b"P6"])
@pytest.mark.parametrize("white", [100, 255, 1023, 4095, 65535])
def test_white_of_a_pnm_file_is_white(tmp_path, kind, white):
    channels = 3 if kind in (b"P3", b"P6") else 1
    full = 255 if white < 256 else 65535
    values = np.repeat([0, white // 4, white // 2, white], channels)
    body = b" ".join(b"%d" % one for one in values) + b"\n"
    if kind in (b"P5", b"P6"):
        body = values.astype("u1" if full == 255 else ">u2").tobytes()
    path = tmp_path / "photo.pnm"
    path.write_bytes(kind + b"\n# made by hand\n2 2\n%d\n" % white + body)
    right = np.rint(np.array([0, white // 4, white // 2, white]) * (full / white))
    grey = read_grey(path).ravel()
    assert grey.dtype == (np.uint8 if full == 255 else np.uint16)
    assert np.abs(grey - right).max() <= 1


@pytest.mark.parametrize("order", ["<", ">"])
def test_alpha_does_not_darken_a_tiff(tmp_path, order):
    """Colours that alpha is not multiplied into, as image editors save them."""
    colours = np.random.default_rng(0).integers(60, 250, (5, 7, 4)).astype(np.uint8)
    colours[..., 3] = np.arange(7) * 40
    tags = [(256, 7), (257, 5), (258, None), (259, 1), (262, 2), (273, 200), (277, 4), (278, 5)]
    tags += [(279, 140), (284, 1), (338, 2)]
    data = bytearray(b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8)
    data += struct.pack(order + "H", len(tags))
    for tag, value in tags:
        how = (tag, 3, 4, 180) if value is None else (tag, 3, 1)
        pack = "HHII" if value is None else "HHIHH"
        data += struct.pack(order + pack, *how, *(() if value is None else (value, 0)))
    data = data.ljust(180, b"\0") + struct.pack(order + "4H", 8, 8, 8, 8)
    data = data.ljust(200, b"\0") + colours.tobytes()
    path = tmp_path / "photo.tif"
    path.write_bytes(bytes(data))
    np.testing.assert_array_equal(read_picture(path)[..., 2::-1], colours[..., :3])


def test_an_animation_is_no_photo(tmp_path):
    still = cv2.imencode(".webp", np.full((40, 50, 3), 90, np.uint8))[1].tobytes()
    chunk = b"VP8X" + struct.pack("<IB3x3s3s", 10, 2, b"\x31\0\0", b"\x27\0\0")
    path = tmp_path / "photo.webp"
    path.write_bytes(b"RIFF" + struct.pack("<I", len(still) + 10) + b"WEBP" + chunk + still[12:])
    with pytest.raises(PhotoError, match="is an animation: save its pictures one by one"):
        read_picture(path)


def _apng(pictures: int) -> bytes:
    data = cv2.imencode(".png", np.full((4, 5, 3), 90, np.uint8))[1].tobytes()
    body = b"acTL" + struct.pack(">II", pictures, 0)
    control = struct.pack(">I", 8) + body + struct.pack(">I", zlib.crc32(body))
    return data[:33] + control + data[33:]


@pytest.mark.parametrize(
    ("pages", "says"),
    [
        ([(50, 40), (50, 40)], "holds several pictures: save them one by one"),
        ([(50, 40), (25, 20)], None),  # a thumbnail
    ],
)
def test_a_file_of_several_pages_is_no_photo(tmp_path, pages, says):
    """Only the first would be used, in silence."""
    path = tmp_path / "pages.tif"
    cv2.imwritemulti(str(path), [np.full((high, wide, 3), 90, np.uint8) for wide, high in pages])
    if says is None:
        assert read_picture(path).mean() == 90
        return
    with pytest.raises(PhotoError, match=says):
        read_picture(path)


def test_a_png_file_of_several_pictures_is_an_animation(tmp_path):
    (tmp_path / "two.png").write_bytes(_apng(2))
    with pytest.raises(PhotoError, match="is an animation: save its pictures one by one"):
        read_picture(tmp_path / "two.png")
    (tmp_path / "one.png").write_bytes(_apng(1))
    assert read_picture(tmp_path / "one.png").mean() == 90
