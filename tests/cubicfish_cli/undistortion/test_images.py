from pathlib import Path

import cv2
import numpy as np
import pytest
from lenses import cubic_camera
from synthetic import lens_of_size

from cubicfish import OutputError, ViewError, build_map, read_picture, save_map, undistort
from cubicfish.photos import PictureFile
from cubicfish.views import CentralView, ChosenView, render
from cubicfish_cli.undistortion import batch
from cubicfish_cli.undistortion.batch import Job, Views, write_one
from cubicfish_cli.undistortion.images import (
    encode_picture,
    jpeg_like,
    with_segments,
    write_picture,
)

LENS = lens_of_size(0.125)
WIDTH, HEIGHT = LENS.image_size
MAP = build_map(LENS, CentralView.with_field("perspective", 160, (70, 50), (0, 0.3, 0.2)))
RNG = np.random.default_rng(2)


def undistort_picture_file(source, out, made, quality=None, *, overwrite):
    job = Job(name=source.name, photos={"": source}, outputs={"": out})

    def render(job, photos):
        return {"": undistort(photos[""], made)}

    problem = write_one(job, render, quality=quality, overwrite=overwrite)
    if problem is not None:
        raise problem


def picture(dtype=np.uint8, channels=1):
    top = 1 if dtype == np.float32 else np.iinfo(dtype).max
    values = RNG.uniform(0, top, (HEIGHT, WIDTH, channels)).astype(dtype)
    values = cv2.GaussianBlur(values, (0, 0), 2)
    return values.reshape(HEIGHT, WIDTH, channels) if channels > 1 else values


@pytest.mark.parametrize("suffix", [".png", ".tif", ".TIFF"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_file_becomes_what_cv2_makes_of_the_written_map(tmp_path, suffix, dtype, channels):
    source, out, npz = (tmp_path / name for name in ("in.png", f"out{suffix}", "map.npz"))
    cv2.imwrite(str(source), picture(dtype, channels))
    undistort_picture_file(source, out, MAP, overwrite=False)
    save_map(npz, MAP, overwrite=False)
    with np.load(npz) as data:
        stored = cv2.imread(str(source), cv2.IMREAD_UNCHANGED)
        expected = cv2.remap(stored, data["map_x"], data["map_y"], cv2.INTER_LINEAR)
    made = cv2.imread(str(out), cv2.IMREAD_UNCHANGED)
    assert made.dtype == dtype
    assert made.shape == ((50, 70) if channels == 1 else (50, 70, channels))
    np.testing.assert_array_equal(made, expected)
    assert 0.3 < MAP.valid.mean() < 1
    assert (made[~MAP.valid] == 0).all()
    assert made[MAP.valid].mean() > 50


def test_a_photo_of_another_size_is_refused_with_both_sizes(tmp_path):
    source = tmp_path / "turned.png"
    cv2.imwrite(str(source), picture().T)
    with pytest.raises(ViewError, match=rf"turned.png.*{HEIGHT}x{WIDTH}.*{WIDTH}x{HEIGHT}"):
        undistort_picture_file(source, tmp_path / "out.png", MAP, overwrite=False)
    assert not (tmp_path / "out.png").exists()
    with pytest.raises(ViewError, match="neither scaled nor cropped"):
        undistort(picture()[1:], MAP)


def test_nothing_is_overwritten_unasked(tmp_path):
    source, out = tmp_path / "in.png", tmp_path / "out.png"
    cv2.imwrite(str(source), picture())
    out.write_text("kept")
    with pytest.raises(OutputError, match="overwrite=True"):
        undistort_picture_file(source, out, MAP, overwrite=False)
    assert out.read_text() == "kept"
    undistort_picture_file(source, out, MAP, overwrite=True)
    assert read_picture(out).shape == (50, 70)


def test_jpeg_has_quality_95(tmp_path):
    values = picture(channels=3)
    write_picture(tmp_path / "out.jpg", values, overwrite=False)
    expected = cv2.imencode(".jpg", values, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    assert (tmp_path / "out.jpg").read_bytes() == expected
    assert expected != cv2.imencode(".jpg", values, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()


@pytest.mark.parametrize(
    ("suffix", "dtype", "channels"),
    [
        (".png", np.uint16, 4),
        (".tif", np.uint16, 3),
        (".tif", np.float32, 1),
        (".tif", np.float32, 3),
        (".tiff", np.float32, 4),
        (".bmp", np.uint8, 1),
        (".bmp", np.uint8, 3),
        (".webp", np.uint8, 3),
        (".webp", np.uint8, 4),
        (".pgm", np.uint16, 1),
        (".ppm", np.uint16, 3),
        (".ppm", np.uint8, 3),
    ],
)
def test_what_a_kind_of_file_can_hold_comes_back(tmp_path, capfd, suffix, dtype, channels):
    values = picture(dtype, channels)
    if channels == 4:
        values[..., 3] += dtype(1) - (
            values[..., 3] > 0
        )  # WebP drops the colour of what is wholly transparent
    write_picture(tmp_path / f"p{suffix}", values, overwrite=False)
    written = tmp_path / f"p{suffix}"
    read = PictureFile.read(written).picture(floats=True)
    np.testing.assert_array_equal(read, values)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("suffix", "dtype", "channels", "says"),
    [
        (".jpg", np.uint16, 1, "grey of 16 bits"),
        (".jpeg", np.uint8, 4, "colour and transparency of 8 bits"),
        (".webp", np.uint8, 1, "grey"),
        (".bmp", np.uint16, 3, "colour of 16 bits"),
        (".pgm", np.uint8, 3, "colour"),
        (".ppm", np.uint8, 1, "grey"),
        (".png", np.float32, 3, r"colour of 32 bits: write \.tif"),
        (".png", np.uint8, 2, "2 channels"),
    ],
)
def test_what_it_cannot_hold_is_refused(tmp_path, suffix, dtype, channels, says):
    with pytest.raises(OutputError, match=says):
        write_picture(tmp_path / f"p{suffix}", picture(dtype, channels), overwrite=False)
    assert not list(tmp_path.iterdir())


def test_floating_point_pictures_stay_so(tmp_path):
    values = picture(np.float32, 3) * np.float32(7)  # beyond 1, as such pictures are
    cv2.imwrite(str(tmp_path / "in.tif"), values, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    undistort_picture_file(tmp_path / "in.tif", tmp_path / "out.tif", MAP, overwrite=False)
    made = cv2.imread(str(tmp_path / "out.tif"), cv2.IMREAD_UNCHANGED)
    assert made.dtype == np.float32
    np.testing.assert_array_equal(made, cv2.remap(values, MAP.map_x, MAP.map_y, 1))
    assert made.max() > 2


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic", "lanczos"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_what_is_unseen_is_black_and_has_no_part_in_the_picture(interpolation, dtype):
    top = 1 if dtype == np.float32 else np.iinfo(dtype).max
    flat = np.full((HEIGHT, WIDTH, 3), top / 4, dtype)
    made = undistort(flat, MAP, interpolation=interpolation)
    assert not made[~MAP.valid].any()
    # No ringing against the border at the photo's edge.
    np.testing.assert_allclose(made[MAP.valid], top / 4, rtol=0.02)


def test_interpolations_are_cv2s():
    photo = picture(channels=3)
    inner = (MAP.map_x > 4) & (MAP.map_x < WIDTH - 5)
    inner &= (MAP.map_y > 4) & (MAP.map_y < HEIGHT - 5)
    results = []
    for name, flag in [("nearest", 0), ("linear", 1), ("cubic", 2), ("lanczos", 4)]:
        made = undistort(photo, MAP, interpolation=name)
        expected = cv2.remap(photo, MAP.map_x, MAP.map_y, flag)
        np.testing.assert_array_equal(made[inner], expected[inner])
        results.append(made)
    assert not np.array_equal(results[0], results[1])


def test_what_the_camera_does_not_see_is_transparent():
    photo = np.full((HEIGHT, WIDTH, 4), 255, np.uint8)
    for interpolation in ("linear", "cubic"):
        made = undistort(photo, MAP, interpolation=interpolation)
        assert not made[~MAP.valid].any()
        assert (made[MAP.valid] == 255).all()


def test_quality_is_the_one_asked_for():
    values = picture(channels=3)
    sizes = [len(encode_picture(Path("a.jpg"), values, quality=q)) for q in (20, 60, 95)]
    assert sizes == sorted(sizes)
    assert len(encode_picture(Path("a.webp"), values, quality=40)) < len(
        encode_picture(Path("a.webp"), values)
    )


def test_a_jpegs_nature_goes_from_the_photo_to_the_picture(tmp_path):
    source, out = tmp_path / "in.jpg", tmp_path / "out.jpg"
    body = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x08\0\0\0\0\0\0\0"
    segment = b"\xff\xe1" + (len(body) + 2).to_bytes(2, "big") + body
    options = [cv2.IMWRITE_JPEG_QUALITY, 71, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111]
    data = cv2.imencode(".jpg", picture(channels=3), options)[1].tobytes()
    source.write_bytes(with_segments(data, segment))
    undistort_picture_file(source, out, MAP, overwrite=False)
    assert jpeg_like(out.read_bytes()) == jpeg_like(source.read_bytes())
    assert jpeg_like(out.read_bytes())[1] == segment
    # Undistorted as the sensor saw it; only who looks at it turns it: 8 is a quarter turn.
    assert read_picture(out).shape[:2] == (50, 70)
    assert cv2.imread(str(out)).shape[:2] == (70, 50)
    undistort_picture_file(source, out, MAP, 30, overwrite=True)
    assert jpeg_like(out.read_bytes())[0][1] == 30


@pytest.mark.parametrize("kind", ["perspective", "cylindrical"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic", "lanczos"])
def test_a_picture_is_the_same_some_rows_at_a_time(monkeypatch, kind, interpolation):
    camera = cubic_camera(100.0)
    width, height = camera.image_size
    photo = (200 * np.random.default_rng(3).random((height, width, 3))).astype(np.uint8)
    view = CentralView.with_field(kind, 150, (301, 231))
    views, job = (
        Views(camera, view, interpolation),
        Job(name="a", photos={"": Path("a")}, outputs={"": Path("b")}),
    )
    whole = views(job, {"": photo})[""]
    monkeypatch.setattr(render, "_BAND_PIXELS", 2000)
    monkeypatch.setattr(batch, "_MOST_KEPT", 2000)
    monkeypatch.delattr(ChosenView, "maps")  # nothing makes the whole map
    anew = Views(camera, view, interpolation)
    np.testing.assert_array_equal(anew(job, {"": photo})[""], whole)
