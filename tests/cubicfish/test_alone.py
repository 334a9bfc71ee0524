"""The library without the program: what it reports has facts, and no sentences."""

import subprocess
import sys
from pathlib import Path

import pytest

from cubicfish.errors import DetectionError, FitError
from cubicfish.judge.codes import Code, Remedy
from cubicfish.judge.finding import Finding, FindingText, of_record

ALONE = """
import sys
sys.modules["cubicfish_cli"] = None  # as where it is not installed
import numpy as np
from cubicfish.calibration import calibrate, save_camera
from cubicfish.errors import CubicfishError
from cubicfish.io.camera_yaml import load_camera
from cubicfish.io.corners_csv import load_corners
from cubicfish.observe.detection import detect
from cubicfish.target.target import Target

target = Target.load(sys.argv[1] + "/target.yaml")
corners = load_corners(sys.argv[1] + "/true_corners.csv", target)
fitted = calibrate(corners, refine_target="off", hold_out=False)
print(repr(fitted))
print(fitted)
save_camera(sys.argv[2], fitted)
loaded = load_camera(sys.argv[2])
assert str(loaded) == str(fitted)
try:
    detect([np.zeros((300, 400), np.uint8)] * 2, target)
except CubicfishError as error:
    print(error)
"""


@pytest.mark.slow
def test_the_library_needs_no_program(tmp_path: Path) -> None:
    data = Path(__file__).parents[2] / "sample_data"
    line = [sys.executable, "-c", ALONE, str(data), str(tmp_path / "camera.yaml")]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shown, figures, judged, refused = done.stdout.splitlines()
    assert shown == f"<Calibration: {figures}>"
    assert judged == "usable with care: not_held_out: photos 10"
    assert refused == "2 photos, no checkerboard: too_dark: images photo_0, photos 2"


def test_a_finding_shows_its_code_and_figures() -> None:
    finding = Finding(
        code=Code.BOARD_SQUARE,
        case="units",
        boards=("wall",),
        images=("a", "b", "c", "d"),
        figures={"times": 2.54001, "units_mixed": "inches_cm"},
    )
    told = "images a+b+c and 1 more, boards wall, times 2.54, units_mixed inches_cm"
    assert str(finding) == f"board_square (units): {told}"
    assert finding.as_record()["what"] == str(finding)
    assert str(Finding(code=Code.DOTS)) == "dots"


def test_a_finding_says_what_was_written_for_it() -> None:
    text = FindingText("it is off", evidence="by 3 px", do="look")
    finding = Finding(code="of_an_extension", help=Remedy.LEAVE_OUT, text=text)
    assert str(finding) == "it is off (by 3 px); look"
    assert finding.remedy is Remedy.LEAVE_OUT
    assert of_record(finding.as_record()) == finding
    assert Finding(code="of_an_extension").remedy is Remedy.CHECK


@pytest.mark.parametrize(
    ("what", "do", "told"),
    [
        ("", "", "it is off: look"),
        ("no fit", "", "no fit: it is off; look"),
        ("no fit", "take more", "no fit: take more; it is off; look"),
    ],
)
def test_an_error_tells_the_first_of_its_findings(what: str, do: str, told: str) -> None:
    finding = Finding(code=Code.ZOOM, figures={"focal_off": 0.5})
    error = FitError(what, do=do, findings=[finding, Finding(code=Code.DOTS)])
    assert str(error).endswith("zoom: focal_off 0.5")
    assert error.text({}, lambda _: ("it is off", "look")) == told


def test_an_error_keeps_its_findings_amid_other_words() -> None:
    error = DetectionError(findings=[Finding(code=Code.DOTS)]).amid("camera left: ")
    again = error.amid("no frame: ", "; frames stay")
    assert isinstance(again, DetectionError)
    assert str(error) == "camera left: dots"
    assert str(again) == "no frame: camera left: dots; frames stay"
    told = again.text({}, lambda finding: (f"<{finding.code}>", ""))
    assert told == "no frame: camera left: <dots>; frames stay"
