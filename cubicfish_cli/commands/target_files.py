"""What a target is worth for someone who is about to take photos: facts, and words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli.app.diagnosis.object_check import ObjectFacts, Turn, check_object
from cubicfish_cli.app.words.catalogue import catalogue
from cubicfish_cli.app.words.phrases import Sentences
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.units import MILLIMETRES

_SENTENCES = Sentences()
_FULL_RANK = 20
# More examples than this are not read.
_MOST = 4
# Squares that differ by more than this are in different units; single ones are within these.
_ONE_UNIT = 50.0
_FINEST_MM, _LARGEST_MM = 0.2, 2000.0


_FACTS = ("corners", "planes", "rank", "flat", "named_by", "ambiguous", "look_alikes", "crossing")


@dataclass(frozen=True, kw_only=True)
class TargetCheck:
    """A target, what was found of it, and what that means.

    Attributes:
        target: the target.
        facts: what was found.
        advice: (what it is about, text) for each thing that is worth saying, in order.
        drawing: the file of a drawing; None where there is none.

    """

    target: Target
    facts: ObjectFacts
    advice: list[tuple[str, str]]
    drawing: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "units": self.target.units,
            "boards": [_board_record(board) for board in self.target.boards],
            **{name: getattr(self.facts, name) for name in _FACTS},
            "symmetries": list(map(_turn_record, self.facts.symmetries)),
            "advice": [{"about": label, "text": text} for label, text in self.advice],
            **({} if self.drawing is None else {"drawing": self.drawing}),
        }


def check_target(target: Target) -> TargetCheck:
    """Judge a target before photos: which boards and photos may be mistaken for others.

    Args:
        target: the target, as it is printed.

    """
    facts = check_object(target)
    return TargetCheck(target=target, facts=facts, advice=_advise(target, facts))


def print_size(board: Board) -> list[float]:
    """Width and height of the print; of a list of points its extent along x, y and z."""
    if board.points is not None:
        extent = board.points.max(axis=0) - board.points.min(axis=0)
        return [round(float(side), 6) for side in extent]
    rim = 2 * board.rim
    end = board.plane_points(board.columns - 1, board.rows - 1) + rim
    return [round(float(side), 6) for side in end]


def _board_record(board: Board) -> dict[str, Any]:
    record: dict[str, Any] = {
        "name": board.name,
        "type": board.kind,
        "columns": board.columns,
        "rows": board.rows,
        "print": print_size(board),
    }
    if board.points is not None:
        return record
    markers = board.markers
    return {
        **record,
        "square": board.square,
        "origin": board.origin,
        "x_axis": board.x_axis,
        "y_axis": board.y_axis,
        "faces": -board.axes[2] + 0.0,
        "markers": None
        if markers is None
        else {"dictionary": markers.dictionary, "first": markers.first, "count": markers.count},
    }


def _turn_record(turn: Turn) -> dict[str, Any]:
    return {
        "angle_deg": turn.angle_deg,
        "axis": turn.axis,
        "onto": dict(zip(turn.boards, turn.onto, strict=True)),
    }


def _advise(target: Target, facts: ObjectFacts) -> list[tuple[str, str]]:
    """(what it is about, text) for each thing that is worth saying, in order."""
    photos = "several" if facts.flat else "one"
    left = _FULL_RANK - facts.rank
    return [
        ("Photos", _say(f"photos_{photos}")),
        *(("Names", text) for text in _advise_on_names(target, facts)),
        *(("Places", _say("crossing", one=a, other=b)) for a, b in facts.crossing[:_MOST]),
        *(("Sizes", text) for text in _advise_on_sizes(target)),
        ("Point lift", _say(f"rank_less_{min(left, 2)}", rank=facts.rank, left=left)),
    ]


def _say(key: str, **figures: Any) -> str:
    return _SENTENCES.vformat(catalogue().checks[key], (), figures)


def _advise_on_names(target: Target, facts: ObjectFacts) -> Iterator[str]:
    plain, alone = facts.plain, len(facts.plain) == 1
    if facts.named_by != "geometry":
        yield _say(f"by_{facts.named_by}")
        if plain and facts.named_by == "markers":
            yield _say("without_markers", boards=", ".join(plain), count=len(plain))
        return
    more = len(facts.symmetries) - _MOST
    for turn in facts.symmetries[:_MOST]:
        yield _say("same", turned=_describe_turn(turn, alone=alone), alone=alone)
    if more > 0:
        yield _say("same_more", more=more)
    oblong = any(board.has_squares and board.columns != board.rows for board in target.boards)
    if facts.symmetries:
        yield _say("upright", oblong=alone and oblong)
    elif alone:
        yield _say("by_colours", board=plain[0])
    if not alone:
        groups = [_say("group", boards=own) for own in facts.look_alikes if len(own) > 1]
        turned = [own[0] for own in facts.look_alikes if len(own) == 1]
        alike = "; ".join([*groups, *([_say("itself", boards=turned)] if turned else [])])
        yield _say("alike", alike=alike) if alike else _say("told_each")


def _advise_on_sizes(target: Target) -> Iterator[str]:
    """Lengths that look like those of another unit."""
    printed = [board for board in target.boards if board.points is None]
    if not printed:
        return
    *_, large = ordered = sorted(printed, key=lambda board: board.square)
    small = ordered[0]
    figures = {"large": large.square, "small": small.square, "units": target.units}
    factor = MILLIMETRES.get(target.units.lower())
    if large.square > _ONE_UNIT * small.square:
        times = large.square / small.square
        yield _say("two_units", **figures, times=times, one=large.name, other=small.name)
    elif factor is not None and not _FINEST_MM <= factor * large.square <= _LARGEST_MM:
        yield _say("odd_unit", **figures, is_small=factor * large.square < _FINEST_MM)


def _describe_turn(turn: Turn, *, alone: bool) -> str:
    if alone:
        return _say("turned_alone", angle_deg=turn.angle_deg, board=turn.boards[0])
    axis = ", ".join(f"{round(float(value), 2) + 0.0:g}" for value in turn.axis)
    moved = ", ".join(f"{a} → {b}" for a, b in zip(turn.boards, turn.onto, strict=True))
    return _say("turned", angle_deg=turn.angle_deg, axis=axis, moved=moved)
