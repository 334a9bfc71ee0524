"""What calibrate prints, in which order, and what it says is next."""

import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import Run
from samples import SAMPLE
from terminals import Screen, widest

from cubicfish import Finding, Verdict
from cubicfish.judge import Code, ErrorStatistics, Severity
from cubicfish_cli.commands import calibrate
from cubicfish_cli.terminal import figures, terminal
from cubicfish_cli.terminal.figures import PhotoRow

CORNERS, TARGET = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
CAMERA = Path("calibration") / "camera.yaml"
GOOD = Verdict(level="good", figures="off by 0.1 px", reasons=())


CARE = Verdict(level="care", reasons=(Finding(code=Code.LOW_COVERAGE, severity=Severity.CARE),))


def bad(code: Code, **figures: float) -> Verdict:
    reason = Finding(code=code, severity=Severity.BAD, figures=figures)
    return Verdict(level="bad", figures="off by 9 px", reasons=(reason,))


@pytest.mark.parametrize(
    ("judged", "camera", "photo", "says"),
    [
        (GOOD, CAMERA, Path("photos/a b.JPG"), "cubicfish undistort 'photos/a b.JPG' flat.jpg\n"),
        (GOOD, Path("l") / "camera.yaml", None, "cubicfish undistort PHOTO flat.png --model l\n"),
        (CARE, CAMERA, Path("a.jpg"), "Next: cubicfish advise\n      cubicfish undistort a.jpg "),
        (bad(Code.NO_FIGURES), CAMERA, Path("a.jpg"), "Next: open calibration/report.html\n"),
        (bad(Code.SMALL_FIELD, share=0.1), CAMERA, None, "Next: cubicfish advise\n"),
        (
            bad(Code.LARGE_ERRORS, error_px=2.0),
            CAMERA,
            None,
            "target check 'a b.yaml'\n",
        ),
    ],
)
def test_what_is_next_can_be_pasted_or_mends_it(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    judged: Verdict,
    camera: Path,
    photo: Path | None,
    says: str,
) -> None:
    monkeypatch.setattr(terminal, "verbosity", lambda: 0)
    files = Path("a b.yaml"), camera.with_name("report.html")
    calibrate.print_next_steps(judged, camera, photo, *files)
    said = capsys.readouterr().out
    assert says in said
    assert said.count("\n") == 2 + (judged.level == "care")
    assert ("undistort" in said) == (judged.level != "bad")
    monkeypatch.setattr(terminal, "verbosity", lambda: -1)
    calibrate.print_next_steps(judged, camera, photo, *files)
    assert capsys.readouterr().out == ""


@pytest.mark.usefixtures("quick_fit")
def test_the_headline_is_first_and_last_and_the_verdict_ends_the_screen(
    run: Run, tmp_path: Path
) -> None:
    line = ("calibrate", CORNERS, "-t", TARGET, "--no-hold-out", "-o", tmp_path / "c")
    said = run(*line).stdout
    first, *lines = said.splitlines()
    found = re.fullmatch(
        r"(0\.\d+ px where corners were, ±0\.\d+ px over the field, \d+ % of the photo "
        "calibrated): usable with care",
        first,
    )
    assert found
    assert found[1] in lines[-7:]
    places = [said.index(words) for words in ("960x720 px, sees", "RMS reprojection", "corner_",
                                              "wrote ", "verdict: ", "Next: ")]  # fmt: skip
    assert places == sorted(places)
    # Of ten photos that are good the worst three are shown.
    shown = [line.split() for line in lines if line.startswith("corner_")]
    assert [row[-1] for row in shown] == ["good"] * 3
    assert "10 photos good; all of them: -v, or " in said
    every = run(*line, "--overwrite", "-v").stdout
    assert every.count("\ncorner_") == 10


@pytest.mark.slow
def test_what_is_next_names_a_photo_that_was_used(run: Run, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    shutil.copytree(SAMPLE / "photos", photos)
    cv2.imwrite(str(photos / "aaa.png"), np.zeros((720, 960), np.uint8))
    said = run("calibrate", photos, "-t", TARGET, "--no-hold-out", "-o", tmp_path / "c").stdout
    assert "aaa.png" in said  # left out
    assert "      cubicfish undistort" in said[said.index("Next: ") :]
    assert "aaa.png" not in said[said.index("Next: ") :]


def test_best_is_refused_where_there_is_nothing_to_choose_from(run: Run, tmp_path: Path) -> None:
    args = ("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "c", "--most", 3)
    assert "--most goes with photos" in run(*args, code=2).stderr
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("columns", [80, 140])
def test_a_terminal_shows_the_worst_twelve(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(figures, "verbosity", lambda: 0)
    rows = [
        PhotoRow(name=f"p{n:02}.jpg", words="good", level="good", boards={"board": 40}, corners=40,
                 errors=ErrorStatistics(rms_px=n / 100, median_px=n / 120, p95_px=n / 60))
        for n in range(1, 41)
    ]  # fmt: skip
    figures.print_photo_table(rows, ["board"])
    shown = [line.split()[0] for line in screen.text.splitlines() if line.startswith("p")][1:]
    assert shown == [f"p{n:02}.jpg" for n in range(40, 28, -1)]
    assert widest(screen.text) <= columns
