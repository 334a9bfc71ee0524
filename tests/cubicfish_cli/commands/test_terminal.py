"""What a terminal shows, and what a pipe gets: on real terminals, through the real entry point."""

import io
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import click
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import cubic_camera
from running import Run
from samples import SAMPLE
from terminals import Screen, on_terminal, unstyled, visible, widest

from cubicfish.judge import CameraFacts, ErrorStatistics, FitRecord, PhotoRecord
from cubicfish.judge.fit_record import DroppedCorner
from cubicfish_cli.terminal import progress
from cubicfish_cli.terminal.figures import PhotoRow, fitted_rows, print_photo_table
from cubicfish_cli.terminal.parameters import SIZE
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import (
    print_json,
    print_table,
    result,
    safe,
    wrapped,
)

CORNERS = SAMPLE / "true_corners.csv"
TARGET = SAMPLE / "target.yaml"
NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=60)
WIDE = "カメラ_魚眼レンズ_広角_テスト撮影_左前_一番目.jpg"


@pytest.fixture(autouse=True)
def plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")


def screen(monkeypatch: pytest.MonkeyPatch, columns: int) -> Screen:
    """A terminal in the place of stdout."""
    shown = Screen()
    monkeypatch.setattr(sys, "stdout", shown)
    monkeypatch.setenv("COLUMNS", str(columns))
    return shown


def photo(name: str, rms: float, **more: object) -> PhotoRow:
    words = more.pop("words", "good")
    return PhotoRow(
        name=name,
        words=str(words),
        short=str(more.pop("short", "")),
        level="good" if words == "good" else "care",
        boards={"floor": 54, "left": 40, "right": 30},
        corners=124,
        errors=ErrorStatistics(rms_px=rms, median_px=rms / 2, p95_px=rms * 2, max_px=rms * 3),
    )


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """Print the table of photos, on a terminal or not; return the text."""
    monkeypatch.setattr("cubicfish_cli.terminal.figures.verbosity", lambda: 0)

    def printed(rows: Sequence[PhotoRow], columns: int | None) -> str:
        with monkeypatch.context() as patch:
            if columns is None:
                patch.setattr(sys, "stdout", stream := __import__("io").StringIO())
            else:
                stream = screen(patch, columns)
            print_photo_table(rows, ["floor", "left", "right"], everything="camera.yaml")
        return unstyled(stream.getvalue())

    return printed


# ---------------------------------------------------------------------------- real terminals


@pytest.mark.slow
def test_a_terminal_gets_colours_and_lines_that_fit(calibrated: Path) -> None:
    model = calibrated / "camera.yaml"
    ended = on_terminal("evaluate", CORNERS, "-t", TARGET, "-m", model, columns=60)
    assert ended.code == 0
    assert "\x1b[32mgood\x1b[0m" in ended.screen
    assert "\x1b[1mphoto" in ended.screen
    assert widest(ended.settled) <= 60
    rows = [line.split() for line in unstyled(ended.settled).splitlines()]
    assert sum(row[0].startswith("corner_") for row in rows if row) == 10


@pytest.mark.slow
def test_no_color_and_forty_columns(calibrated: Path) -> None:
    model = calibrated / "camera.yaml"
    ended = on_terminal("evaluate", CORNERS, "-t", TARGET, "-m", model, columns=40, NO_COLOR="1")
    assert ended.code == 0
    assert "\x1b" not in ended.settled
    assert widest(ended.settled) <= 40
    header = next(line for line in ended.settled.splitlines() if line.startswith("photo"))
    assert "rms px" in header
    assert "verdict" in header
    assert "median" not in header


@pytest.mark.slow
def test_progress_names_the_stage_and_leaves_nothing_behind(tmp_path: Path) -> None:
    args = ["calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "c", "--no-report"]
    ended = on_terminal(*args, piped=True)
    assert ended.code == 0
    # A stage that ends within the line's patience is not shown: which one is, the machine decides.
    assert re.search("(held-out photos|shapes|single corners|may be wrong)", ended.screen)
    assert "%" in ended.screen
    assert ended.screen.rindex("\x1b[?25h") > ended.screen.rindex("\x1b[?25l")  # the cursor
    assert visible(ended.screen) == ["Fitting to 1,139 corners."]
    # The other stream is a pipe: no escape, no cut, no wrap, nothing left out.
    assert "\x1b" not in ended.stdout
    assert max(map(len, ended.stdout.splitlines())) > 100
    header = next(line for line in ended.stdout.splitlines() if line.startswith("photo"))
    assert " ".join(header.split()) == (
        "photo corners floor left right rms px median 95 % largest verdict"
    )
    assert "\nverdict: good\n" in ended.stdout


@pytest.mark.slow
def test_the_verdict_is_the_last_thing_on_a_small_screen(tmp_path: Path) -> None:
    args = [
        "calibrate",
        CORNERS,
        "-t",
        TARGET,
        "-o",
        tmp_path / "c",
        "--no-hold-out",
        "--no-report",
    ]
    ended = on_terminal(*args, "--no-report", columns=80)
    last = unstyled(ended.screen).splitlines()[-23:]
    assert all(len(line) <= 80 or str(tmp_path) in line for line in last)
    assert sum("px where corners were" in line for line in last) == 1
    (verdict,) = [number for number, line in enumerate(last) if line.startswith("verdict: ")]
    assert len(last) - verdict < 12
    assert [line for line in last if line.startswith("Next: ")] == [
        f"Next: cubicfish advise {tmp_path / 'c'}"
    ]


def test_long_work_says_what_it_does_in_a_file_too(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "EVERY_SECONDS", 0.02)
    said = ""
    with click.Context(click.Command("detect")), How().run() as run:
        run.listener.progress("Looking for corners", 3, 10)
        deadline = time.monotonic() + 10
        while said.count("\n") < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
            said += capfd.readouterr().err
        run.listener.progress("Fitting")
    lines = said.splitlines()
    assert len(lines) >= 2
    assert all(re.fullmatch(r"Looking for corners: 3/10, \d+ s", line) for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["quiet", "dumb"])
def test_no_progress_where_none_is_wanted(tmp_path: Path, how: str) -> None:
    args = ["calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "c", "--no-report"]
    if how == "quiet":
        ended = on_terminal(*args, "--no-hold-out", "-q", piped=True)
        assert ended.screen == ""
    else:
        ended = on_terminal(*args, "--no-hold-out", TERM="dumb")
        assert "\x1b" not in ended.screen
        assert "Fitting to 1,139 corners." in ended.screen
        assert "\n\n\n" not in ended.screen.replace("\r", "")
    assert ended.code == 0


@pytest.mark.slow
def test_ctrl_c_leaves_a_clean_terminal(tmp_path: Path) -> None:
    ended = on_terminal(
        *["calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "c", "--refine-target", "points"],
        interrupt_at="\x1b[?25l",  # the line of progress begins
    )
    assert ended.code == 130
    assert visible(ended.screen) == ["Fitting to 1,139 corners.", "Interrupted."]
    assert ended.screen.rindex("\x1b[?25h") > ended.screen.rindex("\x1b[?25l")
    assert not (tmp_path / "c" / "camera.yaml").exists()


@pytest.mark.slow
def test_an_encoding_without_our_signs_gets_their_numbers(calibrated: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    model = calibrated / "camera.yaml"
    text = CORNERS.read_text().replace("corner_01.jpg", WIDE)
    (tmp_path / "corners.csv").write_text(text, encoding="utf-8")
    args = ["evaluate", tmp_path / "corners.csv", "-t", TARGET, "-m", model]
    said = subprocess.run(
        [sys.executable, "-m", "cubicfish_cli", *map(str, args)],
        env=environment,
        capture_output=True,
        check=True,
    ).stdout.decode("ascii")
    assert r"sqrt(mean(dx\xb2 + dy\xb2))" in said
    assert "\\u30ab" in said  # a name keeps its letters apart
    rows = [line for line in said.splitlines() if line.endswith("good")]
    assert len(rows) == 10
    assert len({line.rindex("good") for line in rows}) == 1


# ---------------------------------------------------------------------------- tables


@pytest.mark.parametrize("columns", [40, 60, 80, 140])
def test_a_table_of_photos_fits_any_terminal(show, columns: int) -> None:  # type: ignore[no-untyped-def]
    rows = [
        photo("corner_01.jpg", 0.1),
        photo(
            WIDE,
            0.2,
            words="7 times the others' error; look at it; 12 dropped",
            short="7× the others; 12 dropped",
        ),
        photo("2026-11-21T07-13-44.123456_session_camera_front_0001.jpg", 0.3),
        PhotoRow(name="dark.jpg", words="nothing found", level="bad"),
    ]
    text = show(rows, columns)
    assert widest(text) <= columns
    if columns >= 40:
        words = " ".join(text.split())
        assert "nothing found" in words
        assert "× the others;" in words or "7 times the others'" in words
        assert re.search(r"^2026-11-21T", text, re.MULTILINE)
    assert ("floor" in text) == (columns >= 80)


def test_a_pipe_has_every_column_and_row(show) -> None:  # type: ignore[no-untyped-def]
    rows = [photo(f"{i:04d}_{'long' * 20}.jpg", 0.1 + i / 1e4) for i in range(200)]
    lines = show(rows, None).splitlines()
    assert len(lines) == 201
    assert [line.split()[0] for line in lines[1:]] == [row.name for row in rows]
    assert len({len(line) for line in lines[1:]}) == 1


def test_of_many_photos_the_worst_and_the_odd_are_shown(show) -> None:  # type: ignore[no-untyped-def]
    rows = [photo(f"{i:04d}.jpg", 0.1 + i / 1e5) for i in range(1000)]
    rows[17] = photo("0017.jpg", 0.05, words="few corners")
    rows[500] = photo("0500.jpg", 0.9)
    rows[700] = PhotoRow(name="0700.jpg", words="left out", level="bad")
    text = show(rows, 80)
    shown = re.findall(r"^(\d{4}\.jpg)", text, re.MULTILINE)
    assert {"0017.jpg", "0500.jpg", "0700.jpg", "0999.jpg"} <= set(shown)
    assert len(shown) < 30
    assert shown[0] == "0700.jpg"
    flat = " ".join(text.split())
    assert "998 photos good; all of them: -v, or camera.yaml" in flat


def test_a_photo_that_takes_no_part_has_its_row(show) -> None:  # type: ignore[no-untyped-def]
    photos = (PhotoRecord(image="a.jpg", corners=100, rms_px=0.1),)
    dropped = tuple(DroppedCorner(image=f"{name}.jpg") for name in "abb")
    by_board, lost = {"a.jpg": {"left": 100}}, {"b.jpg": "left out"}
    known = CameraFacts(
        camera=cubic_camera(), fit=FitRecord(per_image=photos, dropped_corners=dropped)
    )
    rows = fitted_rows(known, by_board, lost)
    assert [(row.name, row.words, row.level) for row in rows] == [
        ("a.jpg", "1 dropped", "care"),
        ("b.jpg", "left out", "bad"),
    ]
    assert show(rows, 120).splitlines()[-1].split()[:2] == ["b.jpg", "-"]


def test_names_that_do_not_fit_go_on_below(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = screen(monkeypatch, 30)
    name = "floor_with_a_rather_long_name"
    print_table(("board", "moved mm", "n"), [(name, "1.25", "2")])
    rows = shown.text.splitlines()[1:]
    assert "".join(row.split()[0] for row in rows) == name
    assert rows[0].split()[1:] == ["1.25", "2"]


CELLS = st.sampled_from(["", "-", "1", "-2.50", "1,024", "1e-5", "good", WIDE, "e\u0301té", "⚠️"])


@given(st.lists(st.tuples(CELLS, CELLS, CELLS), max_size=4))
def test_a_pipe_gets_the_table_that_a_painted_one_is(rows: list[tuple[str, str, str]]) -> None:
    shown = []
    for painted in ("", "1"):
        with pytest.MonkeyPatch.context() as patch:
            stream = io.StringIO()
            patch.setattr(sys, "stdout", stream)
            patch.setenv("FORCE_COLOR", painted)
            print_table(("photo", "rms px", "verdict"), rows)
        shown.append([line.rstrip() for line in unstyled(stream.getvalue()).splitlines()])
    assert shown[0] == shown[1]


def test_names_cannot_steer_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = screen(monkeypatch, 80)
    print_table(("photo", "n"), [("\x1b[31mred\x07\u202egpj.exe\r\x9b2J", "1")])
    result("wrote \x1b]0;title\x07/tmp/a\x9b")
    lines = shown.text.splitlines()
    assert lines[1].startswith(r"\x1b[31mred\x07\u202egpj.exe\r\x9b2J")
    assert lines[2] == r"wrote \x1b]0;title\x07/tmp/a\x9b"


# ---------------------------------------------------------------------------- characters


@pytest.mark.slow
@given(NAMES)
def test_safe_text_is_one_line_without_controls(text: str) -> None:
    shown = safe(text)
    assert len(shown.splitlines()) <= 1
    assert not any(ord(c) < 32 or 127 <= ord(c) < 160 or 0x202A <= ord(c) <= 0x202E for c in shown)
    assert safe("naïve ° 二.jpg") == "naïve ° 二.jpg"


@given(st.lists(st.text("abcd", min_size=1, max_size=30), min_size=1), st.integers(20, 60))
def test_wrapped_lines_keep_their_words(words: list[str], columns: int) -> None:
    line = "  ".join(words[:2]) + "".join(f" {word}" for word in words[2:])
    lines = wrapped(line, columns).split("\n")
    assert " ".join(lines).split() == words
    for row in lines:
        assert len(row) <= columns or any(len(word) >= columns // 2 - 2 for word in row.split())


def test_a_broken_line_goes_on_indented() -> None:
    line = "coverage                    100 %   of that field holds corners"
    assert wrapped(line, 100) == line
    assert wrapped(line, 60).split("\n") == [
        "coverage                    100 %   of that field holds",
        "    corners",
    ]
    assert wrapped("wrote /" + "a" * 50, 20) == "wrote\n    /" + "a" * 50  # the path is whole


def test_json_is_json_in_any_encoding(capsysbinary: pytest.CaptureFixture[bytes],
                                      monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    for encoding in ("utf-8", "ascii", "latin-1"):
        raw = io.BytesIO()
        stream = io.TextIOWrapper(raw, encoding=encoding, errors="backslashreplace")
        monkeypatch.setattr(sys, "stdout", stream)
        print_json({"file": "é二\udcff²"})
        stream.flush()
        assert json.loads(raw.getvalue().decode(encoding)) == {"file": "é二\udcff²"}


@pytest.mark.slow
def test_force_color_paints_a_pipe(
    run: Run, calibrated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    args = ["evaluate", CORNERS, "-t", TARGET, "-m", calibrated / "camera.yaml"]
    assert "\x1b" not in run(*args).stdout
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert "\x1b[32mgood" in run(*args).stdout
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in run(*args).stdout


@pytest.mark.parametrize("text", ["1280x800", " 1280 X 800 ", "1280×800"])
def test_sizes_are_read(text: str) -> None:
    assert SIZE.convert(text, None, None) == (1280, 800)


@pytest.mark.parametrize("text", ["", "1280", "0x800", "1280x800x3", "1e3x800", "-1x5", "٣x٣"])
def test_sizes_that_are_not_are_refused(text: str) -> None:
    with pytest.raises(click.UsageError, match="is not an image size: write WIDTHxHEIGHT"):
        SIZE.convert(text, None, None)
