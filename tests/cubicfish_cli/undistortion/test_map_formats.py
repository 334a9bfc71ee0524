"""Maps for other programs, each read back by the program that it is for."""

import shlex
import shutil
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from lenses import cubic_camera
from saved_maps import read_map

from cubicfish import OutputError, UndistortMap, UsageError, ViewError, build_map, save_map
from cubicfish.files import write_files
from cubicfish.views import CentralView, MapInBands, bands
from cubicfish.views.bands import build_redistort_map
from cubicfish.views.view import MAX_SIDE, rotation_from_angles
from cubicfish_cli.undistortion.map_formats import (
    ffmpeg_command,
    map_contents,
    map_paths,
    stmap,
    write_exr,
)

CAMERA = cubic_camera(100.0)  # 960x720
VIEW = CentralView.with_field("perspective", 150, (192, 108), rotation_from_angles(yaw_deg=25))
MAP = build_map(CAMERA, VIEW)
VALID = MAP.valid


def written(path: Path, pixel_map: UndistortMap = MAP) -> tuple[Path, ...]:
    paths = map_paths(path)[""]
    write_files(map_contents(paths, MapInBands.of(pixel_map)), overwrite=False)
    return paths


def smooth_photo() -> np.ndarray:
    noise = np.random.default_rng(5).integers(0, 255, (720, 960, 3)).astype(np.uint8)
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 8), None, 0, 255, cv2.NORM_MINMAX)


PHOTO = smooth_photo()
FLAT = cv2.remap(PHOTO, MAP.map_x, MAP.map_y, cv2.INTER_LINEAR)


def test_the_map_has_both_kinds_of_pixels():
    assert 0.5 < VALID.mean() < 0.95


@pytest.mark.parametrize("suffix", [".npz", ".exr", ".png", ".pgm"])
@pytest.mark.parametrize("back", [False, True])
def test_a_map_made_in_bands_gives_the_same_files(tmp_path, monkeypatch, suffix, back):
    if suffix == ".exr":
        pytest.importorskip("OpenEXR")
    small = CAMERA.for_photos((96, 72))
    way = partial(build_redistort_map if back else build_map, small, VIEW)
    whole = way()
    sizes = []

    def make(rows):
        sizes.append(len(rows))
        return way(rows)

    size = whole.map_x.shape[::-1]
    before = [path.read_bytes() for path in written(tmp_path / f"whole{suffix}", whole)]
    monkeypatch.setattr(bands, "_BAND_PIXELS", 10 * size[0] + 7)
    banded = MapInBands(view=VIEW, size=size, make=make)
    paths = map_paths(tmp_path / f"banded{suffix}")[""]
    write_files(map_contents(paths, banded), overwrite=False)
    assert [path.read_bytes() for path in paths] == before
    assert max(sizes) == 10
    assert sum(sizes) == size[1]  # once only, also where there are two files
    np.testing.assert_array_equal(banded.valid, whole.valid)


def test_a_saved_map_is_what_numpy_writes(tmp_path):
    save_map(tmp_path / "m.npz", MAP)
    read = dict(np.load(tmp_path / "m.npz"))
    np.savez(tmp_path / "again.npz", **read)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "m.npz").read_bytes()


def test_a_saved_map_is_what_numpy_reads(tmp_path):
    path = tmp_path / "m.npz"
    save_map(path, MAP)
    before, read = path.read_bytes(), read_map(path)
    np.testing.assert_array_equal(read.map_x, MAP.map_x)
    np.testing.assert_array_equal(read.map_y, MAP.map_y)
    np.testing.assert_array_equal(read.valid, MAP.valid)
    assert read.format == "cubicfish undistort_map 1"
    assert read.central_view == VIEW
    assert read.image_size == (960, 720)
    with pytest.raises(OutputError, match="overwrite=True"):
        save_map(path, MAP)
    assert path.read_bytes() == before
    other = CentralView(kind="perspective", size=(5, 4), focal=3.0)
    save_map(path, build_map(CAMERA, other), overwrite=True)
    assert read_map(path).map_x.shape == (4, 5)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def from_shares(u, v, size=(960, 720)):
    """What a compositing program does with an STMap whose y grows upwards."""
    return u * size[0] - 0.5, (1 - v) * size[1] - 0.5


def test_an_exr_stmap_is_read_by_openexr(tmp_path):
    openexr = pytest.importorskip("OpenEXR")
    (path,) = written(tmp_path / "m.exr")
    with openexr.File(str(path), separate_channels=True) as file:
        u, v = (file.channels()[name].pixels for name in "RG")
        assert set(file.channels()) == {"R", "G", "B"}
    assert u.dtype == v.dtype == np.float32
    x, y = from_shares(u.astype(float), v.astype(float))
    np.testing.assert_allclose(x[VALID], MAP.map_x[VALID], atol=1e-3)
    np.testing.assert_allclose(y[VALID], MAP.map_y[VALID], atol=1e-3)
    assert (u[~VALID] == -1).all()
    assert (v[~VALID] == -1).all()


def test_y_of_an_stmap_grows_upwards():
    top = np.argmin(np.where(VALID, MAP.map_y, np.inf))
    assert stmap(MAP)[1].flat[top] > 0.8


def test_an_exr_that_cannot_be_written_is_said_to_be_so(tmp_path):
    pytest.importorskip("OpenEXR")
    with pytest.raises(OSError, match=r"^No such file or directory$"):
        write_exr(tmp_path / "none" / "m.exr", MapInBands.of(MAP))


def test_without_openexr_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    with pytest.raises(OutputError, match=r"pip install 'cubicfish\[exr\]'"):
        written(tmp_path / "m.exr")


def test_the_png_pair_holds_shares_in_16_bits(tmp_path):
    paths = written(tmp_path / "m.png")
    assert [path.name for path in paths] == ["m_x.png", "m_y.png"]
    x, y = (cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in paths)
    assert x.dtype == y.dtype == np.uint16
    assert ((x == 0) == ~VALID).all()
    assert ((y == 0) == ~VALID).all()
    map_x, map_y = from_shares(x / 65535, y / 65535)
    assert np.abs(map_x - MAP.map_x)[VALID].max() <= 960 / 65535 / 2 + 1e-3
    assert np.abs(map_y - MAP.map_y)[VALID].max() <= 720 / 65535 / 2 + 1e-3


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_the_pgm_pair_is_what_ffmpeg_takes(tmp_path):
    paths = written(tmp_path / "m 1.pgm")
    assert [path.name for path in paths] == ["m 1_x.pgm", "m 1_y.pgm"]
    cv2.imwrite(str(tmp_path / "in.png"), PHOTO)
    command = ffmpeg_command(*paths).replace("in.mp4", "in.png").replace("out.mp4", "out.png")
    subprocess.run(
        [*shlex.split(command), "-loglevel", "error", "-frames:v", "1"],
        cwd=tmp_path,
        check=True,
        stdin=subprocess.DEVNULL,
    )
    made = cv2.imread(str(tmp_path / "out.png"))
    nearest = PHOTO[np.rint(MAP.map_y).astype(int), np.rint(MAP.map_x).astype(int)]
    assert made.shape == FLAT.shape
    # ffmpeg may go through its own colours on the way.
    assert np.abs(made.astype(int) - nearest)[VALID].mean() < 2
    assert made[~VALID].max() < 20


@pytest.mark.slow
@pytest.mark.parametrize("view", [VIEW, CentralView.with_field("equidistant", 200, (160, 120))])
def test_the_way_back_undoes_the_way_there(view):
    there = build_map(CAMERA, view)
    back = build_redistort_map(CAMERA, view)
    assert back.map_x.shape == (720, 960)
    assert back.image_size == view.size
    # The undistort map, read where the way back points, says where we came from.
    grid = np.stack([there.map_x, there.map_y], axis=-1)
    found = cv2.remap(grid, back.map_x, back.map_y, cv2.INTER_CUBIC)
    trusted = cv2.remap(there.valid.astype(np.float32), back.map_x, back.map_y, cv2.INTER_CUBIC)
    inside = back.valid & (trusted > 0.999) & (trusted < 1.001)
    assert inside.mean() > 0.1
    error = np.abs(found - np.stack(np.meshgrid(np.arange(960), np.arange(720)), axis=-1))
    # cv2.remap rounds to 1/32 of the view's pixels, each of which is several of the photo's.
    assert np.median(error[inside]) < 0.3
    assert (back.map_x[~back.valid] == -1).all()


@pytest.mark.slow
def test_the_way_back_is_exact_by_the_camera():
    back = build_redistort_map(CAMERA, VIEW)
    y, x = np.nonzero(back.valid)
    view_pixel = np.stack([back.map_x[y, x], back.map_y[y, x]], axis=-1).astype(float)
    again = CAMERA.project(VIEW.rays(view_pixel))
    np.testing.assert_allclose(again, np.stack([x, y], axis=-1), atol=2e-3)


def test_unknown_suffixes_are_refused():
    with pytest.raises(UsageError, match=r"m\.tif"):
        map_paths(Path("m.tif"))


@pytest.mark.parametrize("size", [(MAX_SIDE + 1, 10), (10, MAX_SIDE + 1)])
def test_photos_larger_than_opencv_remaps_are_not_rendered_again(size):
    with pytest.raises(ViewError, match=f"{MAX_SIDE} pixels at most"):
        build_redistort_map(replace(CAMERA, image_size=size), VIEW)
