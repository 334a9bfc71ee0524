"""``advise``, ``report`` and ``evaluate`` on a folder that a program saved, not ``calibrate``."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from running import Run
from samples import SAMPLE

from cubicfish import Calibration, Target
from cubicfish_cli import load_corners, save_camera, save_corners

TARGET = SAMPLE / "target.yaml"

Saved = Callable[..., Path]


@pytest.fixture
def saved(fitted: Calibration, tmp_path: Path) -> Saved:
    """The sample's calibration as a program saves it; with what else is named."""

    def save(*names: str) -> Path:
        folder = tmp_path / "saved"
        folder.mkdir()
        save_camera(folder / "camera.yaml", fitted)
        if "corners.csv" in names:
            corners = load_corners(SAMPLE / "true_corners.csv", Target.load(TARGET))
            save_corners(folder / "corners.csv", corners)
        if "target.yaml" in names:
            shutil.copy(TARGET, folder / "target.yaml")
        return folder

    return save


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
@pytest.mark.parametrize("beside", [True, False])
def test_the_object_is_beside_it_or_named(run: Run, saved: Saved, beside: bool) -> None:
    folder = saved("corners.csv", *["target.yaml"] * beside)
    named = () if beside else ("--target", TARGET)
    advice = run("advise", folder, *named)
    assert "uncertainty" in advice.stdout
    assert "Enough" in advice.stdout
    said = run("report", folder, *named)
    assert "Corners and errors" not in said.stderr
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Errors as arrows" in page
    model, table = folder / "camera.yaml", SAMPLE / "true_corners.csv"
    assert "verdict: good" in run("evaluate", table, "-m", model, "-t", TARGET).stdout


NO_TARGET = "no target.yaml is beside the camera"
NO_CORNERS = "there is no corners.csv beside the camera"


@pytest.mark.parametrize(
    ("names", "why", "do"),
    [
        (["corners.csv"], NO_TARGET, "name the target with --target"),
        (["target.yaml"], NO_CORNERS, "with --corners"),
        ([], NO_CORNERS, "with --corners"),
    ],
)
def test_what_is_missing_is_said_in_one_line(
    run: Run, saved: Saved, names: list[str], why: str, do: str
) -> None:
    said = run("advise", saved(*names), code=1).stderr
    assert said.count("\n") == 1
    assert why in said
    assert do in said


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
@pytest.mark.parametrize(
    ("names", "why"), [(["corners.csv"], NO_TARGET), (["target.yaml"], NO_CORNERS)]
)
def test_a_page_says_what_is_missing(run: Run, saved: Saved, names: list[str], why: str) -> None:
    folder = saved(*names)
    (line,) = [line for line in run("report", folder).stderr.splitlines() if "Corners" in line]
    assert why in line
    assert why in (folder / "report.html").read_text(encoding="utf-8")


def test_a_fitted_object_is_asked_for_by_its_file(run: Run, saved: Saved) -> None:
    folder = saved("corners.csv", "target.yaml")
    camera = folder / "camera.yaml"
    text = camera.read_text(encoding="utf-8")
    rms = text.partition("  rms_px: ")[2].partition("\n")[0]
    changed = text.replace("  refine_target: off", "  refine_target: shape").replace(
        "  refine_target: 'off'", "  refine_target: shape"
    )
    assert changed != text
    camera.write_text(changed, encoding="utf-8")
    said = run("advise", folder, code=1).stderr
    assert "target.refined.yaml is not beside the camera: name the target with --target" in said
    # The object as drawn is not the one of such a fit.
    camera.write_text(changed.replace(f"  rms_px: {rms}\n", "  rms_px: 0.5\n"), encoding="utf-8")
    said = run("advise", folder, "--target", TARGET, code=1).stderr
    assert "not those of the fit (the target was fitted too, and target.refined.yaml holds" in said
    assert said.count("\n") == 1
