"""``cubicfish calibrate --lift point`` and ``project`` with what it writes."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from running import Run
from samples import SAMPLE

from cubicfish import Target, load_camera, load_corners

TARGET = SAMPLE / "target.yaml"


@pytest.fixture(scope="module")
def one_photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The corners of one photo of three boards."""
    lines = (SAMPLE / "true_corners.csv").read_text().splitlines()
    path = tmp_path_factory.mktemp("one") / "one.csv"
    path.write_text("\n".join(lines[:2] + [line for line in lines if "corner_01" in line]))
    return path


def test_one_photo_gives_a_camera_of_its_boards(run: Run, one_photo: Path, tmp_path: Path) -> None:
    args = ["calibrate", one_photo, "-t", TARGET, "--lift", "point"]
    record = json.loads(run(*args, "-o", tmp_path / "a", "--json").stdout)
    assert set(record) >= {"rms_px", "median_px", "p95_px", "max_px", "corners", "images", "model"}
    assert (record["frame"], record["rank"], record["dropped"]) == ("world", 19, 0)
    assert record["held_out_rms_px"] is None
    assert record["rms_px"] < 1
    assert record["summary"].startswith("960x720 px, error ")
    said = run(*args, "-o", tmp_path / "b").stdout
    assert re.match(r"0\.\d+ px where corners were, \d+ % of the photo calibrated: ", said)
    assert (tmp_path / "b" / "camera.yaml").read_text().startswith(f"# {record['summary']}\n")
    assert "19     of 20: P means something on the boards only" in said
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == [
        "camera.yaml",
        "corners.csv",
    ]
    model = tmp_path / "a" / "camera.yaml"
    target = Target.load(TARGET)
    pairs = load_corners(one_photo, target)
    text = "".join(f"{x},{y},{z}\n" for x, y, z in pairs.world.tolist())
    pixels = np.array(
        [line.split(",") for line in run("project", "-m", model, input=text).stdout.splitlines()],
        float,
    )
    away = np.linalg.norm(pixels - pairs.pixel, axis=1)
    assert np.sqrt(np.mean(away**2)) == pytest.approx(record["rms_px"])
    assert (
        "point 60, 61, 62 is off the boards: the corners gave P rank 19"
        in run("project", "-m", model, input=text + "60,61,62\n", code=1).stderr
    )
    said = run("unproject", "-m", model, input="1,2\n", code=1).stderr
    assert (
        "is of lift 'point', which has no rays: it serves 'project' and 'undistort --view "
        "plane:BOARD' alone; calibrate with --lift ray for this"
    ) in said


@pytest.mark.slow
def test_several_photos_and_the_gate(run: Run, tmp_path: Path) -> None:
    args = ["calibrate", SAMPLE / "true_corners.csv", "-t", TARGET, "--lift", "point"]
    said = run(*args, "-o", tmp_path, "--max-rms", 0.001, code=3).stdout
    assert "10 photos" in said
    camera = load_camera(tmp_path / "camera.yaml", any_lift=True).camera
    assert (camera.frame, camera.rank) == ("camera", 20)  # type: ignore[union-attr]
    assert "exists already" in run(*args, "-o", tmp_path, code=1).stderr
