"""``cubicfish map``: which files it writes, for which photos, and what it says."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from running import Run
from saved_maps import read_map

from cubicfish import load_camera


@pytest.fixture
def model(calibrated: Path) -> Path:
    return calibrated / "camera.yaml"


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("m.npz", ["m.npz"]),
        ("m.exr", ["m.exr"]),
        ("m.png", ["m_x.png", "m_y.png"]),
        ("m.pgm", ["m_x.pgm", "m_y.pgm"]),
    ],
)
def test_each_kind_is_written_with_its_camera(
    run: Run, model: Path, tmp_path: Path, name: str, files: list[str]
) -> None:
    if name.endswith("exr"):
        pytest.importorskip("OpenEXR")
    out = tmp_path / "out"
    said = run("map", out / name, "-m", model, "--size", "96x72").stdout
    expected = [*files, "m.view.yaml"]
    assert sorted(path.name for path in out.iterdir()) == sorted(expected)
    lines = said.splitlines()
    assert [line.split(":")[0] for line in lines[: len(expected)]] == [
        f"wrote {out / file}" for file in expected
    ]
    assert lines[0].endswith("96x72 pixels, 120.0° across, focal length 27.71 px")
    assert ("ffmpeg -i in.mp4" in said) == name.endswith("pgm")
    again = run("map", out / name, "-m", model, code=1).stderr
    assert "exists already" in again
    run("map", out / name, "-m", model, "--size", "40x30", "--overwrite")
    assert yaml.safe_load((out / "m.view.yaml").read_text())["image_size"] == [40, 30]


def test_without_openexr_the_error_names_the_file_that_was_asked_for(
    run: Run, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    out = tmp_path / "m.exr"
    said = run("map", out, "-m", model, "--size", "96x72", code=1).stderr
    needs = "EXR files need one more package: pip install 'cubicfish[exr]'"
    assert said == f"Error: {out}: {needs}\n"
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_when_one_file_exists(run: Run, model: Path, tmp_path: Path) -> None:
    (tmp_path / "m.view.yaml").write_text("mine")
    assert "m.view.yaml exists" in run("map", tmp_path / "m.npz", "-m", model, code=1).stderr
    assert [path.name for path in tmp_path.iterdir()] == ["m.view.yaml"]


def test_the_map_of_a_rescaled_photo(run: Run, model: Path, tmp_path: Path) -> None:
    view = ["-m", model, "--hfov", 80, "--size", "64x48"]
    run("map", tmp_path / "a.npz", *view)
    run("map", tmp_path / "b.npz", *view, "--photo-size", "480x360")
    a, b = (read_map(tmp_path / f"{name}.npz") for name in "ab")
    assert b.image_size == (480, 360)
    np.testing.assert_allclose(b.map_x, (a.map_x + 0.5) / 2 - 0.5, atol=1e-4)
    assert "960x540" in run("map", "d.npz", *view, "--photo-size", "960x540", code=1).stderr


@pytest.mark.slow
def test_the_way_back(run: Run, model: Path, tmp_path: Path) -> None:
    run("map", tmp_path / "m.npz", "-m", model, "--size", "96x72", "--redistort")
    with np.load(tmp_path / "m.npz") as data:
        assert str(data["format"]) == "cubicfish redistort_map 1"
        assert data["map_x"].shape == (720, 960)
        assert data["image_size"].tolist() == [96, 72]
        middle = data["map_x"][364, 475], data["map_y"][364, 475]
    pixel = load_camera(model).camera.project([0.0, 0, 1])
    assert np.hypot(*(pixel - [475, 364])) < 5
    assert np.hypot(middle[0] - 47.5, middle[1] - 35.5) < 1


def test_a_cube_has_six_maps(run: Run, model: Path, tmp_path: Path) -> None:
    run("map", tmp_path / "m.npz", "-m", model, "--view", "cube", "--size", "20x20")
    assert len(list(tmp_path.glob("m_*.npz"))) == 6
    assert read_map(tmp_path / "m_front.npz").valid.all()
    assert len(list(tmp_path.glob("m_*.view.yaml"))) == 6


def test_an_equidistant_views_camera_is_opencvs_fisheye(
    run: Run, model: Path, tmp_path: Path
) -> None:
    run("map", tmp_path / "m.npz", "-m", model, "--view", "equidistant", "--size", "96x72")
    record = yaml.safe_load((tmp_path / "m.view.yaml").read_text())
    assert record["kind"] == "equidistant"
    matrix, coefficients = np.array(record["K"]), np.zeros(4)
    view = read_map(tmp_path / "m.npz").central_view
    ray = np.array([[[0.4, -0.3, 1.0]]])
    pixel, _ = cv2.fisheye.projectPoints(ray, np.zeros(3), np.zeros(3), matrix, coefficients)
    np.testing.assert_allclose(pixel.ravel(), view.pixels(ray.ravel()), atol=1e-6)


def test_ffmpegs_maps_say_what_ffmpeg_does_with_them(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    line = ("map", tmp_path / "m.pgm", "-m", calibrated, "--size", "96x72")
    assert "takes the nearest pixel" in run(*line).stderr
    assert run(*line, "--overwrite", "-q").stderr == ""
