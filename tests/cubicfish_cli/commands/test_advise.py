"""``cubicfish advise`` on folders as calibrate leaves them."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from pairs_csv import write_pairs
from running import Run
from samples import SAMPLE

TARGET = SAMPLE / "target.yaml"


@pytest.fixture(scope="module")
def poor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration from three photos with noise, and nothing on the right of them."""
    from running import run_cli

    folder = tmp_path_factory.mktemp("poor")
    noise = np.random.default_rng(0)
    lines = []
    for number, line in enumerate((SAMPLE / "true_corners.csv").read_text().splitlines()):
        if number < 2:
            lines.append(line)
        elif line.startswith(("corner_02", "corner_05", "corner_06")):
            *name, x, y = line.split(",")
            x, y = (float(value) + 0.15 * noise.standard_normal() for value in (x, y))
            if x < 420:
                lines.append(",".join([*name, str(x), str(y)]))
    (folder / "three.csv").write_text("\n".join(lines) + "\n")
    run_cli("calibrate", folder / "three.csv", "-t", TARGET, "-o", folder / "calibration",
            "--no-hold-out", "--refine-target", "off")  # fmt: skip
    return folder


@pytest.mark.slow
def test_a_poor_calibration(run: Run, poor: Path, tmp_path: Path) -> None:
    svg = tmp_path / "advice.svg"
    said = run("advise", poor / "calibration", "-o", svg).stdout
    assert "Not enough: " in said
    assert "No corners here:" in said
    assert "  1  Put the target " in said
    assert "Lowers the uncertainty over the field from" in said
    assert "  3  Put" in said
    assert f"wrote {svg}" in said
    ElementTree.parse(svg)
    record = json.loads(run("advise", poor / "calibration", "--json").stdout)
    assert record["enough"] is False
    assert len(record["proposals"]) == 3
    assert record["proposals"][0]["gain"] > 0.1
    assert "exists already" in run("advise", poor / "calibration", "-o", svg, code=1).stderr


@pytest.mark.slow
def test_the_goal_is_asked_for(run: Run, calibrated: Path) -> None:
    said = run("advise", calibrated).stdout
    assert "Enough: more photos are not needed." in said
    assert "Put the target" not in said
    demanding = run("advise", calibrated, "--goal", 0.0001, "--json").stdout
    assert json.loads(demanding)["enough"] is False


@pytest.mark.slow
def test_a_verdict_that_asks_for_photos_is_not_contradicted(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    camera = tmp_path / "camera.yaml"
    text = (calibrated / "camera.yaml").read_text()
    changed = text.replace("\n  held_out_rms_px: null\n", "\n  held_out_rms_px: 0.9\n")
    assert changed != text
    camera.write_text(changed)
    given = ("--corners", SAMPLE / "true_corners.csv", "--target", TARGET)
    said = " ".join(run("advise", camera, *given).stdout.split())
    assert "Not enough: the camera is off by 0.900 px on photos left out" in said
    assert "Enough" not in said


@pytest.mark.slow
def test_corners_may_be_named(run: Run, poor: Path, tmp_path: Path) -> None:
    camera = tmp_path / "camera.yaml"
    text = (poor / "calibration" / "camera.yaml").read_text()
    # As on another machine: what the calibration was made from is not where it was.
    camera.write_text(text.replace("three.csv", "gone.csv"))
    said = run("advise", "--model", camera, code=1).stderr
    assert "name the corners with --corners" in said
    assert said.count("\n") == 1
    given = ("--corners", poor / "three.csv", "--target", TARGET)
    assert "Not enough" in run("advise", "--model", camera, *given).stdout
    wrong = ("--corners", SAMPLE / "true_corners.csv", "--target", TARGET)
    # True corners are not those of the fit, which had noise.
    assert "not those of the fit" in run("advise", "--model", camera, *wrong, code=1).stderr


@pytest.mark.slow
def test_what_point_cameras_and_bare_pairs_cannot(run: Run, poor: Path, tmp_path: Path) -> None:
    run("calibrate", poor / "three.csv", "-t", TARGET, "--lift", "point", "-o", tmp_path / "p",
        "--no-hold-out")  # fmt: skip
    said = run("advise", tmp_path / "p", code=1).stderr
    assert "lift 'point'" in said
    assert said.count("\n") == 1
    from cubicfish import Target, load_corners

    target = Target.load(TARGET)
    pairs = load_corners(poor / "three.csv", target)
    write_pairs(tmp_path / "pairs.csv", pairs)
    run("calibrate", "--correspondences", tmp_path / "pairs.csv", "-o", tmp_path / "c",
        "--no-hold-out")  # fmt: skip
    said = run("advise", tmp_path / "c")
    assert "No corners here:" in said.stdout
    assert "came without a target" in said.stderr
    assert "Put the target" not in said.stdout


@pytest.mark.slow
def test_a_picture_is_of_a_known_kind(run: Run, calibrated: Path, tmp_path: Path) -> None:
    said = run("advise", calibrated, "-o", tmp_path / "a.jpg", code=1).stderr
    assert "end the name in .svg, .png, .pdf" in said
    run("advise", calibrated, "-o", tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
