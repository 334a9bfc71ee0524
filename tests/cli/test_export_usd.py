"""Cameras as tables in USD, read back by usd-core and OpenEXR."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import Run

from cubicfish_cli import load_rig
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.undistortion.lens_tables import octahedral_place, octahedral_rays
from tests.cli.test_export_rig import SHIFTS, made_rig

FLIP = np.diag([1.0, -1.0, -1.0])


def channels(path: Path) -> dict[str, np.ndarray]:
    library = pytest.importorskip("OpenEXR")
    with library.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


@pytest.fixture(scope="module")
def written(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Any]:
    from running import run_cli

    pytest.importorskip("OpenEXR")
    folder = tmp_path_factory.mktemp("usd")
    rig = made_rig(calibrated, folder / "rig", 2)
    said = run_cli("export", rig, "--to", "usd", "-o", folder / "usd", "--json").stdout
    return rig, folder / "usd", json.loads(said)


def test_directions_and_their_places_are_inverse() -> None:
    way = np.random.default_rng(0).standard_normal((500, 3))
    rays = way / np.linalg.norm(way, axis=1, keepdims=True)
    place = octahedral_place(rays)
    assert np.abs(place).max() <= 1
    np.testing.assert_allclose(octahedral_rays(place), rays, atol=1e-12)
    np.testing.assert_allclose(octahedral_rays(np.zeros(2)), [0, 0, -1])


@pytest.mark.slow
def test_every_pixel_has_its_direction_and_every_direction_its_pixel(
    written: tuple[Path, Path, Any],
) -> None:
    rig, folder, record = written
    assert record["format"] == "usd"
    assert len(record["files"]) == 5
    camera = load_rig(rig).cameras[0].camera
    enter = channels(folder / "left_enter.exr")
    rays = np.stack([enter[key] for key in "RGB"], axis=-1)
    assert rays.shape == (720, 960, 3)
    rng = np.random.default_rng(1)
    pixel = np.column_stack([rng.integers(0, 960, 400), rng.integers(0, 720, 400)])
    found = rays[pixel[:, 1], pixel[:, 0]]
    true = camera.unproject(pixel.astype(float))
    seen = np.isfinite(true[:, 0])
    np.testing.assert_allclose(found[seen], true[seen] @ FLIP, atol=1e-6)
    assert (found[~seen] == [0, 0, 1]).all()
    leave = channels(folder / "left_leave.exr")
    shares = np.stack([leave["R"], leave["G"]], axis=-1)
    side = len(shares)
    assert side >= 1024
    place = rng.integers(0, side, (400, 2))
    rays = octahedral_rays((2 * place + 1) / side - 1) @ FLIP
    true = camera.project(rays)
    found = shares[place[:, 1], place[:, 0]]
    seen = np.isfinite(true[:, 0])
    assert 100 < seen.sum() < 400
    np.testing.assert_allclose(found[seen] * [960, 720] - 0.5, true[seen], atol=2e-4)
    assert (found[~seen] == -1).all()


@pytest.mark.slow
def test_what_is_lost_between_entries_is_stated(written: tuple[Path, Path, Any]) -> None:
    rig, folder, record = written
    stated = record["cameras"][0]
    # The largest is where the octahedron has its edges.
    assert 0 < stated["rms_px"] < 0.03
    assert stated["rms_px"] < stated["max_px"] < 0.5
    text = (folder / "rig.usda").read_text()
    assert f"largest {stated['max_px']:.4f} px" in text
    # Half-way between two pixels of the first table, as a bilinear reader has it.
    camera = load_rig(rig).cameras[0].camera
    enter = channels(folder / "left_enter.exr")
    rays = np.stack([enter[key] for key in "RGB"], axis=-1).astype(float)
    middle = (rays[:, :-1] + rays[:, 1:]) / 2
    both = (rays[:, :-1, 2] < 1) & (rays[:, 1:, 2] < 1)
    y, x = np.nonzero(both)
    off = camera.project(middle[both] @ FLIP) - np.column_stack([x + 0.5, y])
    assert np.nanmax(np.linalg.norm(off, axis=1)) <= stated["max_px"]


@pytest.mark.slow
def test_usd_reads_the_stage(written: tuple[Path, Path, Any]) -> None:
    pxr = pytest.importorskip("pxr.Usd")
    geometry = pytest.importorskip("pxr.UsdGeom")
    rig, folder, _ = written
    stage = pxr.Stage.Open(str(folder / "rig.usda"))
    assert geometry.GetStageMetersPerUnit(stage) == pytest.approx(0.001)
    prim = stage.GetPrimAtPath("/rig/right")
    assert prim.IsA(geometry.Camera)
    for name in ("rayEnterDirectionTexture", "rayExitPositionTexture"):
        asset = prim.GetAttribute(f"omni:lensdistortion:lut:{name}").Get()
        assert Path(asset.resolvedPath).is_file()
    assert prim.GetAttribute("omni:lensdistortion:model").Get() == "lut"
    assert list(prim.GetAttribute("omni:lensdistortion:lut:opticalCenter").Get()) == [480, 360]
    matrix = np.array(geometry.Camera(prim).ComputeLocalToWorldTransform(0))
    one = load_rig(rig).cameras[1]
    own = np.array([[10.0, 20, 300], [-50, 4, 100]])  # in the camera's frame
    rig_points = (own - one.translation) @ one.rotation
    theirs = np.column_stack([own @ FLIP, np.ones(2)]) @ matrix
    np.testing.assert_allclose(theirs[:, :3], rig_points @ FLIP, atol=1e-9)
    assert np.linalg.norm(SHIFTS[1]) == pytest.approx(np.linalg.norm(matrix[3, :3]))


@pytest.mark.slow
def test_one_camera_and_what_exists(run: Run, calibrated: Path, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    args = ["export", calibrated, "--to", "usd", "-o", tmp_path / "usd"]
    (tmp_path / "usd").mkdir()
    (tmp_path / "usd" / "camera_leave.exr").write_bytes(b"mine")
    assert "camera_leave.exr exists" in run(*args, code=1).stderr
    assert len(list((tmp_path / "usd").iterdir())) == 1
    run(*args, "--max-error", "0.00001", "--overwrite", code=1)
    assert (tmp_path / "usd" / "camera_leave.exr").read_bytes() == b"mine"
    said = run(*args, "--overwrite").stdout
    assert "rig.usda" in said
    assert load_camera(calibrated / "camera.yaml").camera.image_size == (960, 720)
    assert 'def Camera "camera"' in (tmp_path / "usd" / "rig.usda").read_text()
