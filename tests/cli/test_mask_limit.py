"""``--mask-limit``: which pixels of a mask it leaves out, and what it refuses."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from running import SAMPLE, Run
from saved_maps import read_map

from cubicfish_cli.assess.uncertainty import sigma_at
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.plain_yaml import plain_yaml_text
from cubicfish_cli.undistortion.maps import Crop, calibrated_pixels, camera_for_photos

VIEW = ["--view", "equidistant", "--fit", "outer", "--size", "160x120"]
PHOTO = next((SAMPLE / "photos").glob("*.[pj]*g"))


def edited(model: Path, path: Path, uncertainty: Any) -> Path:
    """A copy of a camera file that says something else of its uncertainty."""
    record = yaml.safe_load(model.read_text())
    record["fit"]["uncertainty"] = uncertainty
    path.write_text(plain_yaml_text(record))
    return path


@pytest.fixture
def model(calibrated: Path, tmp_path: Path) -> Path:
    """A camera whose uncertainty is 0.1 pixels on the left of its photos and 1.3 on the right."""
    record = dict(load_camera(calibrated / "camera.yaml").fit["uncertainty"])
    record["sigma_px"] = [np.linspace(0.1, 1.3, len(record["x"])).tolist()] * len(record["y"])
    return edited(calibrated / "camera.yaml", tmp_path / "camera.yaml", record)


def mask_of(run: Run, folder: Path, model: Path, *args: object) -> np.ndarray[Any, Any]:
    """The mask that ``cubicfish map`` writes beside ``m.npz``."""
    run("map", folder / "m.npz", "-m", model, "--mask", folder / "k.png", "--overwrite", *args)
    mask = np.asarray(cv2.imread(str(folder / "k.png"), cv2.IMREAD_UNCHANGED))
    assert set(np.unique(mask)) <= {0, 255}
    return mask == 255


def test_a_tighter_limit_leaves_less(run: Run, calibrated: Path, tmp_path: Path) -> None:
    model = calibrated / "camera.yaml"
    record = load_camera(model).fit["uncertainty"]
    valid = mask_of(run, tmp_path, model, *VIEW)
    made = read_map(tmp_path / "m.npz")
    sigma = sigma_at(record, np.stack([made.map_x, made.map_y], axis=-1)[valid].astype(float))
    wider = valid
    for share in (0.8, 0.4, 0.1):
        limit = float(np.nanquantile(sigma, share))
        mask = mask_of(run, tmp_path, model, *VIEW, "--mask-limit", limit)
        assert 0 < mask.sum() < wider.sum()
        assert not (mask & ~wider).any()
        np.testing.assert_array_equal(mask[valid], sigma <= limit)
        wider = mask
    after = read_map(tmp_path / "m.npz")
    np.testing.assert_array_equal(after.valid, made.valid)  # the map itself stays whole


@pytest.mark.parametrize("photos", [[], ["--photo-size", "480x360"], ["--crop", "640x480+160+100"]])
def test_the_limit_holds_in_pixels_as_calibrated(
    run: Run, model: Path, tmp_path: Path, photos: list[str]
) -> None:
    mask = mask_of(run, tmp_path, model, *VIEW, *photos, "--mask-limit", "0.6")
    made = read_map(tmp_path / "m.npz")
    width = load_camera(model).camera.image_size[0]
    x = made.map_x.astype(float)
    if photos[:1] == ["--photo-size"]:
        x = (x + 0.5) * width / 480 - 0.5
    elif photos:
        x += 160
    within = made.valid & (0.1 + 1.2 * x / (width - 1) <= 0.6)
    assert 0 < within.sum() < made.valid.sum()
    np.testing.assert_array_equal(mask, within)


def test_where_nothing_is_known_is_not_trusted(run: Run, model: Path, tmp_path: Path) -> None:
    record = dict(load_camera(model).fit["uncertainty"])
    record["sigma_px"] = [[None] * 7 + row[7:] for row in record["sigma_px"]]
    mask = mask_of(run, tmp_path, edited(model, model, record), *VIEW, "--mask-limit", "100")
    made = read_map(tmp_path / "m.npz")
    # A grid cell with one known side is known, up to its unknown side.
    np.testing.assert_array_equal(mask, made.valid & (made.map_x > record["x"][6]))
    assert 0 < mask.sum() < made.valid.sum()


@pytest.mark.slow
def test_undistort_writes_the_same_mask(run: Run, model: Path, tmp_path: Path) -> None:
    expected = mask_of(run, tmp_path, model, *VIEW, "--mask-limit", "0.6")
    args = ["-m", model, *VIEW, "--mask", tmp_path / "u.png", "--mask-limit", "0.6"]
    run("undistort", PHOTO, tmp_path / "flat.png", *args)
    mask = cv2.imread(str(tmp_path / "u.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(np.asarray(mask) == 255, expected)


def test_undistort_of_a_rescaled_photo(run: Run, model: Path, tmp_path: Path) -> None:
    args = [*VIEW, "--mask-limit", "0.6"]
    expected = mask_of(run, tmp_path, model, *args, "--photo-size", "480x360")
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((360, 480, 3), np.uint8))
    out = [tmp_path / "small.png", tmp_path / "flat.png", "-m", model, "--mask", tmp_path / "u.png"]
    run("undistort", *out, *args)
    mask = cv2.imread(str(tmp_path / "u.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(np.asarray(mask) == 255, expected)


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--mask-limit", "0.5"], "goes with --mask"),
        (["--mask-limit", "0", "--mask", "k.png"], "--mask-limit"),
        (["--mask-limit", "nan", "--mask", "k.png"], "above 0"),
        (["--mask-limit", "0.5", "--mask", "k.png", "--redistort"], "--redistort"),
    ],
)
def test_what_does_not_go_together(
    run: Run, model: Path, tmp_path: Path, args: list[str], said: str
) -> None:
    assert said in run("map", tmp_path / "m.npz", "-m", model, *args, code=2).stderr
    if "--redistort" not in args:
        flat = tmp_path / "flat.png"
        assert said in run("undistort", PHOTO, flat, "-m", model, *args, code=2).stderr
    assert [path.name for path in tmp_path.iterdir()] == ["camera.yaml"]


@pytest.mark.parametrize(
    "uncertainty",
    [
        None,
        {"x": [0, 1]},
        {"x": [0, 1], "y": [0, 1], "sigma_px": [[1, 2, 3], [1, 2, 3]]},
        {"x": [0], "y": [0, 1], "sigma_px": [[1], [1]]},
        {"x": [1, 0], "y": [0, 1], "sigma_px": [[1, 1], [1, 1]]},
        {"x": 1, "y": [0, 1], "sigma_px": [["a"]]},
    ],
)
def test_a_file_without_a_usable_uncertainty(
    run: Run, model: Path, tmp_path: Path, uncertainty: Any
) -> None:
    edited(model, model, uncertainty)
    args = ["-m", model, "--mask", tmp_path / "k.png"]
    for command in (["map", tmp_path / "m.npz"], ["undistort", PHOTO, tmp_path / "flat.png"]):
        problem = run(*command, *args, "--mask-limit", "0.5", code=1).stderr.strip()
        assert "fit.uncertainty" in problem
        assert "calibrate again with this version" in problem
        assert "\n" not in problem
    assert [path.name for path in tmp_path.iterdir()] == ["camera.yaml"]


def test_calibrated_pixels_undo_the_camera_for_photos(model: Path) -> None:
    camera = load_camera(model).camera
    rays = np.array([[0.1, 0.2, 1.0], [-0.4, 0.1, 1.0]])
    crop = Crop(x=160, y=100, width=640, height=480)
    for size, part in (((480, 360), None), ((320, 240), crop)):
        pixel = camera_for_photos(camera, size, part).project(rays)
        back = calibrated_pixels(pixel, camera.image_size, size, part)
        np.testing.assert_allclose(back, camera.project(rays), atol=1e-9)
