"""What a target was fitted to be, and no paper, plate or wall is."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import synthetic

from cubicfish.diagnosis.diagnose import HYPOTHESES
from cubicfish.diagnosis.wrong_nominal import doubted_boards, odd_distance
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import Departure
from cubicfish.solve.poses import Poses
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.target import Target
from cubicfish_cli.words.sentences import render

TARGET = synthetic.corner_of_three()
NOMINAL = {
    "bend": (0.0, 0.0), "twist": 0.0, "stretch": (0.0, 0.0),
    "shift": 0.0, "turn_deg": 0.0, "offset_rms": 0.0,
}  # fmt: skip


def doubts(offset: Any = (0.0, 0.0, 0.0), **departs: Any) -> list[Finding]:
    """What is said of a board with such departures, all of whose corners have such an offset."""
    departure = Departure(board="left", **{**NOMINAL, **departs})
    index = TARGET.board_names.index("left")
    board = TARGET.boards[index]
    shape = BoardShape.none(board.columns, board.rows)
    shape = replace(shape, offsets=shape.offsets + offset)
    refined = TARGET.with_boards({index: replace(board, shape=shape)})
    fit = SimpleNamespace(world=None, nominal=SimpleNamespace(refined=lambda world: refined))
    seen: Any = SimpleNamespace(target=TARGET, departures=[departure], fit=fit)
    return doubted_boards(seen)


@pytest.mark.parametrize(
    ("departs", "usual", "code", "said"),
    [
        ({"bend": (0.0, -30.0)}, {"bend": (0.5, 0.5)}, Code.BENT, "bent by 30 mm"),
        ({"twist": 30.0}, {"twist": 0.5}, Code.BENT, "bent by 30 mm"),
        ({"stretch": (0.0, -0.04)}, {"stretch": (0.01, 0.01)}, Code.STRETCHED, "by -4.0 %"),
        ({"shift": 30.0}, {"shift": 1.0}, Code.MOVED, "30 mm and 0.0° off its place"),
        ({"turn_deg": 3.0}, {"turn_deg": 1.0}, Code.MOVED, "0 mm and 3.0° off its place"),
        (
            {"offset": (1.2, 1.6, 0.1)},
            {"offset": (0.1, 0.0, 0.1)},
            Code.CORNERS_OFF,
            "off by 2 mm within its plane",
        ),
    ],
)
def test_a_board_is_doubted_beyond_what_prints_and_plates_are(
    departs: dict[str, Any], usual: dict[str, Any], code: Code, said: str
) -> None:
    (found,) = doubts(**departs)
    assert (found.code, found.severity, found.boards) == (code, Severity.CARE, ("left",))
    assert "board left seem" in render(found).what
    assert said in render(found).what
    assert doubts(**usual) == []


def test_waves_are_told_as_waves_and_not_of_corners():
    (found,) = doubts(offset=(0.06, 0.08, 0.7))
    assert (found.code, found.case, found.severity) == (Code.BENT, "wavy", Severity.NOTE)
    assert "0.7 mm (RMS) out of the plane (and 0.1 mm off within it" in render(found).line


def test_what_is_put_down_to_one_fault_is_not_doubted_of_every_board() -> None:
    (own,) = [one for one in HYPOTHESES if one.explain is doubted_boards]
    note, place, zoom = (Finding(code=code) for code in (Code.REPEATS, Code.BOARD_PLACE, Code.ZOOM))
    assert own.applies(None, [note])
    assert not own.applies(None, [note, place])
    assert not own.applies(None, [zoom])


@pytest.mark.parametrize(
    ("square", "units", "asked", "severe"),
    [
        (0.025, "mm", "0.33 mm away", True),
        (0.025, "m", None, False),
        (25.0, "mm", None, False),
        (250.0, "mm", "3.3 m away", False),
        (25.0, "m", "330 m away", True),
        (25.0, "squares", None, False),
    ],
)
def test_a_square_that_puts_the_camera_out_of_reach_is_asked_for(square, units, asked, severe):
    target = Target(units=units, boards=(synthetic.checkerboard("board", 9, 6, square),))
    board, *_, world = target.corners()
    far = Poses(rotation=np.eye(3)[None], translation=np.array([[0.0, 0.0, 12.0]]))
    # In a unit in which a square is 1.
    seen = SimpleNamespace(pairs=SimpleNamespace(image=0 * board, world=world / square))
    fit = SimpleNamespace(reference=seen, poses=far, nominal=SimpleNamespace(scale=square))
    evidence: Any = SimpleNamespace(target=target, fit=fit)
    found = odd_distance(evidence)
    assert [asked in render(one).what for one in found] == ([] if asked is None else [True])
    # Boards on a far wall may be right; none is within a lens, or a hundred metres away.
    assert [one.severity is Severity.CARE for one in found] == [severe] * len(found)
