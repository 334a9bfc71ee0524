import cv2
import numpy as np
import pytest
from synthetic import lens_of_size

from cubicfish_cli.errors import OutputError, PhotoError, ViewError
from cubicfish_cli.photos import read_picture
from cubicfish_cli.undistortion.images import (
    remap_picture,
    undistort_picture_file,
    write_picture,
)
from cubicfish_cli.undistortion.maps import build_map, save_map
from cubicfish_cli.undistortion.views import PerspectiveView

LENS = lens_of_size(0.125)
WIDTH, HEIGHT = LENS.image_size
MAP = build_map(LENS, PerspectiveView.with_field(160, (70, 50), (0, 0.3, 0.2)))
RNG = np.random.default_rng(2)


def picture(dtype=np.uint8, channels=1):
    values = RNG.integers(0, np.iinfo(dtype).max, (HEIGHT, WIDTH, channels)).astype(dtype)
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
        remap_picture(picture()[1:], MAP)


def test_nothing_is_overwritten_unasked(tmp_path):
    source, out = tmp_path / "in.png", tmp_path / "out.png"
    cv2.imwrite(str(source), picture())
    out.write_text("kept")
    with pytest.raises(OutputError, match="--overwrite"):
        undistort_picture_file(source, out, MAP, overwrite=False)
    assert out.read_text() == "kept"
    undistort_picture_file(source, out, MAP, overwrite=True)
    assert read_picture(out).shape == (50, 70)


def test_an_unwritable_name_is_refused_before_any_work(tmp_path):
    with pytest.raises(OutputError, match=r"out\.gif.*\.png"):
        undistort_picture_file(tmp_path / "absent.png", tmp_path / "out.gif", MAP, overwrite=False)
    with pytest.raises(PhotoError, match="absent"):
        undistort_picture_file(tmp_path / "absent.png", tmp_path / "out.png", MAP, overwrite=False)


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
        values[..., 3] |= 1  # WebP drops the colour of what is wholly transparent
    write_picture(tmp_path / f"p{suffix}", values, overwrite=False)
    np.testing.assert_array_equal(read_picture(tmp_path / f"p{suffix}"), values)
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
        (".png", np.uint8, 2, "2 channels"),
    ],
)
def test_what_it_cannot_hold_is_refused(tmp_path, suffix, dtype, channels, says):
    with pytest.raises(OutputError, match=says):
        write_picture(tmp_path / f"p{suffix}", picture(dtype, channels), overwrite=False)
    assert not list(tmp_path.iterdir())
