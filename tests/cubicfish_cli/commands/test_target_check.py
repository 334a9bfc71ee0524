"""``cubicfish target check``: what it prints, draws and refuses."""

import json
import re
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml
from running import Run
from samples import SAMPLE
from synthetic import box_of_four

from cubicfish import Target
from cubicfish_cli.terminal import terminal
from tests.cubicfish_cli.commands.test_main import heavy_modules_after

SVG = "{http://www.w3.org/2000/svg}"
CHARUCO = {
    "name": "marked", "type": "charuco", "corners": [6, 4], "square": 30, "marker": 22,
    "dictionary": "DICT_4X4_50",
}  # fmt: skip


def one(tmp_path: Path, *boards: dict[str, Any]) -> Path:
    path = tmp_path / "target.yaml"
    path.write_text(yaml.safe_dump({"units": "mm", "boards": list(boards)}))
    return path


def checkerboard(columns: int, rows: int) -> dict[str, Any]:
    return {"name": "sheet", "type": "checkerboard", "corners": [columns, rows], "square": 30}


def written(target: Target, tmp_path: Path) -> Path:
    return one(
        tmp_path,
        *(
            {
                "name": board.name,
                "type": board.kind,
                "corners": [board.columns, board.rows],
                "square": board.square,
                "origin": board.origin.tolist(),
                "x_axis": board.x_axis.tolist(),
                "y_axis": board.y_axis.tolist(),
            }
            for board in target.boards
        ),
    )


def said(run: Run, *args: object) -> str:
    """What is printed, on one line."""
    return " ".join(run("target", "check", *args).stdout.split())


def test_the_sample_as_a_table_and_in_words(run: Run) -> None:
    text = run("target", "check", SAMPLE / "target.yaml").stdout
    assert text.splitlines()[1].split() == [
        "floor", "checkerboard", "9x6", "25", "250", "x", "175", "37.5,", "162.5,", "0",
        "+x", "-y", "+z",
    ]  # fmt: skip
    words = " ".join(text.split())
    assert "145 corners on 3 planes" in words
    assert "One photo can be enough" in words
    assert "Seen alone, right looks the same turned." in words
    assert "Places" not in words


@pytest.mark.parametrize("columns", [80, 60])
def test_words_fill_the_lines_of_a_terminal_and_are_broken_once(
    run: Run, monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    plain = run("target", "check", SAMPLE / "target.yaml").stdout.partition("\nTarget")[2]
    assert max(map(len, plain.splitlines())) > 150  # elsewhere a line stays a line
    monkeypatch.setattr(terminal, "columns_of", lambda stream: columns)
    text = run("target", "check", SAMPLE / "target.yaml").stdout.partition("\nTarget")[2]
    assert text.split() == plain.split()
    lines = text.splitlines()[1:]
    assert max(map(len, lines)) <= columns
    for line, following in pairwise(lines):
        if following.startswith(" " * 12):
            first = following.split()[0]
            ends = line.endswith(".")  # another thing to say may begin a line of its own
            assert ends or len(line) + 1 + len(first) > columns


def test_the_box_and_its_half_turn(run: Run, tmp_path: Path) -> None:
    words = said(run, written(box_of_four(), tmp_path))
    assert "Turned by 180° about the axis (0, 0.71, 0.71)" in words
    assert "floor → back" in words
    assert "the lens does not depend on it" in words
    assert "floor, left, back and right look like each other" in words


@pytest.mark.parametrize(("size", "turned"), [((6, 4), True), ((7, 5), True), ((9, 6), False)])
def test_a_flat_board_by_its_colours(
    run: Run, tmp_path: Path, size: tuple[int, int], turned: bool
) -> None:
    words = said(run, one(tmp_path, checkerboard(*size)))
    assert "take ten, tilted" in words
    assert ("Turned by 180° about the middle of sheet it looks the same" in words) == turned
    assert ("The colours of its squares tell" in words) != turned


def test_markers_name_every_corner(run: Run, tmp_path: Path) -> None:
    words = said(run, one(tmp_path, CHARUCO))
    assert "ids name the corners: nothing can be confused" in words
    assert "looks the same" not in words


def test_slips_of_the_pen_are_pointed_at(run: Run, tmp_path: Path) -> None:
    data = yaml.safe_load((SAMPLE / "target.yaml").read_text())
    data["boards"][1].update(y_axis=[0, 0, 1], origin=[50, 37.5, -37.5])
    words = said(run, one(tmp_path, *data["boards"]))
    assert "The prints of floor and left overlap" in words


def test_two_boards_that_are_alike(run: Run, tmp_path: Path) -> None:
    boards = (
        {"name": "a", "origin": [0, 60, 300], "x_axis": [0, 1, 0], "y_axis": [0, 0, -1]},
        {"name": "b", "origin": [300, 0, 300], "x_axis": [-1, 0, 0], "y_axis": [0, 0, -1]},
    )
    words = said(run, one(tmp_path, *(checkerboard(9, 6) | board for board in boards)))
    assert "Seen alone, a and b look like each other." in words


def test_a_length_of_another_unit_is_pointed_at(run: Run, tmp_path: Path) -> None:
    data = yaml.safe_load((SAMPLE / "target.yaml").read_text())
    data["boards"][2]["square"] = 0.025
    words = said(run, one(tmp_path, *data["boards"]))
    assert "A square of right, 0.025 mm, is very small" in words
    assert "Sizes" not in said(run, one(tmp_path, checkerboard(9, 6)))


def drawn(path: Path, group: str) -> list[list[tuple[float, float]]]:
    """The polygons, or the marks, of the groups of a drawing whose id begins so."""
    root = ET.fromstring(path.read_text(encoding="utf-8"))
    groups = [g for g in root.iter(f"{SVG}g") if g.get("id", "").startswith(group)]
    found = []
    for own in groups:
        marks = list(own.iter(f"{SVG}use"))
        found += [[(float(mark.get("x", "")), float(mark.get("y", "")))] for mark in marks]
        for one in [] if marks else own.iter(f"{SVG}path"):
            numbers = [float(n) for n in re.findall(r"-?[\d.]+", one.get("d", ""))]
            found.append(list(zip(numbers[::2], numbers[1::2], strict=True)))
    return found


def words_of(path: Path) -> list[str]:
    root = ET.fromstring(path.read_text(encoding="utf-8"))
    return ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]


def test_json_has_every_fact(run: Run, tmp_path: Path) -> None:
    path = written(box_of_four(), tmp_path)
    record = json.loads(run("target", "check", path, "--json").stdout)
    assert (record["planes"], record["corners"]) == (4, 576)
    assert record["boards"][1]["faces"] == [1, 0, 0]
    assert record["boards"][0]["print"] == [520, 520]
    (turn,) = record["symmetries"]
    assert turn["onto"]["left"] == "right"
    assert turn["angle_deg"] == pytest.approx(180)
    assert record["ambiguous"] is True
    assert record["look_alikes"] == [["floor", "left", "back", "right"]]
    assert {one["about"] for one in record["advice"]} == {"Photos", "Names"}


def test_the_drawing_shows_every_board_where_it_is(run: Run, tmp_path: Path) -> None:
    drawing = tmp_path / "object.svg"
    run("target", "check", SAMPLE / "target.yaml", "--draw", drawing)
    words = words_of(drawing)
    assert {"floor", "left", "right", "corner (0, 0)", "x", "y", "z"} <= set(words)
    # Dark squares of (columns + 1) x (rows + 1): the first one is dark.
    squares = {name: drawn(drawing, f"print of {name}") for name in ("floor", "left", "right")}
    assert sorted(map(len, squares.values())) == [8 * 6 // 2, 70 // 2, 72 // 2]
    assert len(drawn(drawing, "origin of")) == 3
    root = ET.fromstring(drawing.read_text(encoding="utf-8"))
    _, _, width, height = (float(n) for n in root.get("viewBox", "").split())
    for square in [one for each in squares.values() for one in each]:
        assert all(0 <= x <= width and 0 <= y <= height for x, y in square)
        # Printed faces are seen as they are, not mirrored: x right, y down.
        (ax, ay), (bx, by), (cx, cy) = square[:3]
        assert (bx - ax) * (cy - by) - (by - ay) * (cx - bx) > 0


@pytest.mark.parametrize(("first", "dark"), [("dark", 18), ("light", 17)])
def test_squares_are_dark_where_they_are(run: Run, tmp_path: Path, first: str, dark: int) -> None:
    drawing = tmp_path / "object.svg"
    board = checkerboard(6, 4) | {"first_square": first}
    run("target", "check", one(tmp_path, board), "--draw", drawing)
    assert len(drawn(drawing, "print of sheet")) == dark  # of 7 x 5


def test_every_kind_of_board_can_be_drawn(run: Run, tmp_path: Path) -> None:
    place = {"x_axis": [0, 1, 0], "y_axis": [0, 0, -1]}
    tags = {"name": "<tags & co>", "type": "aprilgrid", "tags": [3, 2], "tag": 20, "spacing": 0.3}
    path = one(
        tmp_path,
        CHARUCO | {"origin": [0, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]},
        tags | place | {"origin": [-50, 0, -20]},
        {"name": "dots", "type": "points", "points": [[0, 0, 50], [9, 0, 50], [0, 9, 60]]},
    )
    drawing = tmp_path / "object.svg"
    words = said(run, path, "--draw", drawing)
    assert "dots points 3 - 9 x 9 x 10 0, 0, 50 - - -" in words
    assert len(drawn(drawing, "dots")) == 3
    assert "<tags & co>" in words_of(drawing)
    assert drawing.stat().st_size < 100_000


def test_points_come_from_a_table(run: Run, tmp_path: Path) -> None:
    dots = {"name": "dots", "type": "points", "points": [[0, 0, 50], [9, 0, 50], [0, 9, 60]]}
    drawing = tmp_path / "dots.svg"
    assert "calibrate from a corners.csv" in said(run, one(tmp_path, dots), "--draw", drawing)
    assert len(drawn(drawing, "dots")) == 3


def test_what_cannot_be_done_is_one_line(run: Run, tmp_path: Path) -> None:
    bad = one(tmp_path, checkerboard(1, 4))
    wrong = run("target", "check", bad, code=1)
    assert wrong.stdout == ""
    assert wrong.stderr.startswith("Error: ")
    assert wrong.stderr.count("\n") == 1
    assert "board 'sheet', corners" in wrong.stderr
    sample = SAMPLE / "target.yaml"
    assert ".svg" in run("target", "check", sample, "--draw", "x.png", code=1).stderr
    drawing = tmp_path / "object.svg"
    drawing.write_text("mine")
    assert "exists" in run("target", "check", sample, "--draw", drawing, code=1).stderr
    assert drawing.read_text() == "mine"
    run("target", "check", sample, "--draw", drawing, "--overwrite")
    assert "<svg" in drawing.read_text()


@pytest.mark.parametrize(
    "args", [pytest.param(["target", "-h"], marks=pytest.mark.slow), ["target", "check", "-h"]]
)
def test_help_is_quick_and_has_an_example(run: Run, args: list[str]) -> None:
    assert heavy_modules_after(*args) == "loaded:"
    assert "cubicfish target check target.yaml" in run(*args).output.split("Examples:")[1]
