"""``cubicfish compare``: two camera files, numbers, a picture and a gate."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from running import Run
from samples import SAMPLE


@pytest.fixture(scope="module")
def other(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibrated camera with its picture stretched by 1 % along x about pixel 480."""
    data = yaml.safe_load((calibrated / "camera.yaml").read_text())
    P = np.array(data["P"])
    P[0] = 1.01 * P[0] - 4.8 * P[2]
    data["P"] = P.tolist()
    path = tmp_path_factory.mktemp("other") / "camera.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


@pytest.mark.slow
def test_numbers_in_words_and_in_json(run: Run, calibrated: Path, other: Path) -> None:
    first = calibrated / "camera.yaml"
    record = json.loads(run("compare", first, other, "--json").stdout)
    assert set(record) >= {"rms_px", "median_px", "p95_px", "max_px", "pixels", "by_angle"}
    assert 1 < record["rms_px"] < 3
    assert 3 < record["max_px"] < 6
    assert record["common_share"] > 0.97
    assert record["rotation_deg"] < 0.1
    said = run("compare", first, other).stdout
    assert f"{record['rms_px']:.3f} px" in said
    assert "of what A sees" in said
    same = json.loads(run("compare", first, first, "--json").stdout)
    assert same["max_px"] < 1e-5


def test_a_camera_beside_the_true_lens(run: Run, calibrated: Path) -> None:
    true, found = SAMPLE / "true_camera.yaml", calibrated / "camera.yaml"
    there = json.loads(run("compare", true, found, "--json").stdout)
    back = json.loads(run("compare", found, true, "--json").stdout)
    assert 0.001 < there["rms_px"] < 0.1
    assert back["rms_px"] == pytest.approx(there["rms_px"], rel=0.1)
    assert there["common_share"] > 0.9


def test_the_gate(run: Run, calibrated: Path, other: Path) -> None:
    first = calibrated / "camera.yaml"
    assert run("compare", first, other, "--max-rms", 0.5, code=3).stdout
    run("compare", first, other, "--max-rms", 5)


@pytest.mark.slow
def test_the_picture(run: Run, calibrated: Path, other: Path, tmp_path: Path) -> None:
    first, path = calibrated / "camera.yaml", tmp_path / "difference.png"
    assert f"wrote {path}" in run("compare", first, other, "--picture", path).stdout
    picture = cv2.imread(str(path))
    assert picture.shape[1] == 960
    assert 720 < picture.shape[0] < 820
    middle, side = picture[360, 482].sum(), picture[360, 780].sum()
    assert middle < 150 < side < 765
    assert "exists already" in run("compare", first, other, "--picture", path, code=1).stderr
    bad = run("compare", first, other, "--picture", tmp_path / "x.gif", code=1)
    assert "pictures are written as" in bad.stderr


def test_other_sizes_are_refused(run: Run, calibrated: Path, tmp_path: Path) -> None:
    first = calibrated / "camera.yaml"
    data = yaml.safe_load(first.read_text())
    data["image_size"] = [960, 740]
    del data["fit"]["uncertainty"]
    (tmp_path / "cut.yaml").write_text(yaml.safe_dump(data))
    said = run("compare", first, tmp_path / "cut.yaml", code=1).stderr
    assert "960x720 and 960x740" in said
