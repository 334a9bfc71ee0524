"""The refined object on the command line: written, read back, and left out where nothing moved."""

import json

import pytest
import yaml
from running import Run
from samples import SAMPLE


@pytest.fixture(scope="module")
def bent_target(tmp_path_factory):
    """The sample's object with a drawing that is off: a board 1 mm out of place and stretched."""
    record = yaml.safe_load((SAMPLE / "target.yaml").read_text())
    left = next(board for board in record["boards"] if board["name"] == "left")
    left["origin"][0] += 1.0
    left["square"] *= 1.004
    path = tmp_path_factory.mktemp("bent") / "target.yaml"
    path.write_text(yaml.safe_dump(record))
    return path


@pytest.mark.slow
def test_a_wrong_drawing_is_refined_and_written(run: Run, tmp_path, bent_target):
    corners = SAMPLE / "true_corners.csv"
    folder = tmp_path / "calibration"
    done = run("calibrate", corners, "--target", bent_target, "-o", folder, "--json")
    record = json.loads(done.stdout)
    assert record["refine_target"] in ("shape", "points")
    levels = record["held_out_by_level"]
    assert record["held_out_rms_px"] == levels[record["refine_target"]] < 0.2 * levels["off"]
    moved = {part["board"]: part for part in record["departures"]}
    assert moved["left"]["shift"] == pytest.approx(1.0, abs=0.5)
    refined = folder / "target.refined.yaml"

    def rms(target):
        done = run(
            "evaluate", corners, "--target", target, "--model", folder / "camera.yaml", "--json"
        )
        return json.loads(done.stdout)["rms_px"]

    assert rms(refined) < 0.2 * rms(bent_target)
    # What the drawing is off by is not put down to the camera.
    for target, before in ((bent_target, levels["off"]), (refined, record["held_out_rms_px"])):
        said = run("evaluate", corners, "-t", target, "-m", folder).stdout
        assert f"against {before:.3f} px when it was calibrated" in said
        assert "calibrate again" not in said
    made_by = yaml.safe_load((folder / "camera.yaml").read_text())["made_by"]
    assert made_by["options"]["refine_target"] == "auto"


@pytest.mark.slow
def test_an_exact_drawing_writes_no_second_target(run: Run, tmp_path):
    folder = tmp_path / "calibration"
    done = run(
        "calibrate", SAMPLE / "true_corners.csv", "--target", SAMPLE / "target.yaml", "-o", folder,
        "--refine-target", "off",
    )  # fmt: skip
    assert not (folder / "target.refined.yaml").exists()
    assert "target fitted too" not in done.stdout
    fit = yaml.safe_load((folder / "camera.yaml").read_text())["fit"]
    assert fit["refine_target"] == "off"
    sigma = fit["uncertainty"]["sigma_px"]
    assert len(sigma) == len(fit["uncertainty"]["y"])


def test_an_unknown_level_is_refused(run: Run):
    done = run("calibrate", "x.csv", "--target", "t.yaml", "--refine-target", "all", code=2)
    assert "shape" in done.stderr
