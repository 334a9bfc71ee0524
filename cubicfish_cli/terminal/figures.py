"""The figures of a fit in words: the same words wherever an RMS is shown.

The table of photos that calibrate, evaluate and detect print.

A terminal shows of many photos the odd ones and those with the largest errors; ``--verbose``,
pipes and files have them all.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import click

from cubicfish_cli.terminal.parameters import verbosity
from cubicfish_cli.terminal.terminal import (
    Style,
    columns_of,
    print_always,
    print_message,
    print_table,
    result,
)
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Detection, Finding, Observations, Verdict
    from cubicfish.find import PhotoReport
    from cubicfish.judge import CameraFacts, ErrorStatistics, PhotoRecord
    from cubicfish_cli.render.pages.report_files import ReportFiles
    from cubicfish_cli.terminal.progress import How


EXIT_GATE = 3


def px(value: float | None) -> str:
    """Pixels to three decimals; a dash for what is not known."""
    return "-" if value is None or math.isnan(value) else f"{value:.3f}"


def print_figure(name: str, value: str, unit: str = "px", meaning: str = "") -> None:
    """Print what a figure is called, its value and what it means, in columns."""
    result(f"{name:<24}{value:>7} {unit:<2}  {meaning}".rstrip())


def print_errors(errors: ErrorStatistics, more: Sequence[tuple[str, float, str]]) -> None:
    """Print reprojection errors: the RMS and what it means, other RMS beside it, the spread."""
    lines = [
        ("RMS reprojection error", errors.rms_px, "sqrt(mean(dx² + dy²)) over all corners used"),
        *more,
    ]
    for name, value, meaning in lines:
        print_figure(name, px(value), "" if math.isnan(value) else "px", meaning)
    print_spread(errors)


def print_spread(errors: ErrorStatistics) -> None:
    """Print the median, what 95 % are within and the largest, a line each."""
    print_figure("median", px(errors.median_px))
    print_figure("95 % within", px(errors.p95_px))
    print_figure("largest", px(errors.max_px))


def print_verdict(judged: Verdict, *, alone: bool = False) -> None:
    """Print the verdict in a line, and what else is against the camera in a line each.

    Args:
        judged: the verdict.
        alone: whether the figures of a good one stand elsewhere.

    """
    from cubicfish_cli.words.sentences import render

    first, *others = [f"{one.why}; {one.do}" for one in map(render, judged.reasons)] or [""]
    line = first or ("" if alone else judged.figures)
    result(f"verdict: {judged.words}{f': {line}' * bool(line)}", mark=(judged.words, judged.level))
    for other in others:
        result(f"  also: {other}")


def print_report(made: ReportFiles, how: How) -> None:
    """Print the verdict, the page's file, and what is not on the page."""
    for line in made.absent:
        print_message(f"left out: {line}")
    if not how.print(made):
        print_verdict(made.verdict)
        result(f"\nwrote {made.page}")


def mark_of(finding: Finding) -> str:
    """How a line about a finding begins."""
    return "note" if finding.severity.value == "note" else "warning"


def enforce_max_rms(rms_px: float, max_rms: float | None) -> None:
    """Exit with 3 when the RMS is above the gate that the user set."""
    if max_rms is not None and not rms_px <= max_rms:
        print_always(f"The RMS of {rms_px:.3f} px is above --max-rms {max_rms:g}.")
        click.get_current_context().exit(EXIT_GATE)


ByBoard = Mapping[str, Mapping[str, int]]

GOOD = "good"
_MOST_ROWS = 12
_MOST_GOOD = 3  # where they are folded
_RANK: Mapping[Style, int] = {"bad": 0, "care": 1, "good": 2}
# Below so many columns words of judgement are said shorter, and columns are left out.
_ROOMY, _WIDE, _NARROW, _FEW_BOARDS = 100, 80, 60, 3


@dataclass(frozen=True, kw_only=True)
class PhotoRow:
    """What is said of a photo.

    Attributes:
        name: of the photo.
        words: a word of judgement.
        short: the same where there is little room; empty where there is no shorter one.
        level: how bad that is.
        boards: corners used of each board in it.
        corners: corners used; None for a photo that takes no part.
        dropped: corners left out.
        errors: reprojection errors, where there are any.

    """

    name: str
    words: str
    level: Style
    short: str = ""
    boards: Mapping[str, int] = field(default_factory=dict)
    corners: int | None = None
    dropped: int = 0
    errors: ErrorStatistics | PhotoRecord | None = None

    @property
    def rms_px(self) -> float:
        """RMS of its errors; NaN where there are none."""
        return math.nan if self.errors is None else self.errors.rms_px

    def in_short(self) -> PhotoRow:
        """The same for a narrow table."""
        return replace(self, words=self.short or self.words)


def corners_by_board(corners: Observations) -> dict[str, dict[str, int]]:
    """How many corners each photo has of each board, in the target's order of the boards."""
    import numpy as np

    if not corners.boards:
        return {}
    counts = np.zeros((len(corners.images), len(corners.boards)), int)
    np.add.at(counts, (corners.image, corners.board), 1)
    return {
        image: {board: n for board, n in zip(corners.boards, row, strict=True) if n}
        for image, row in zip(corners.images, counts.tolist(), strict=True)
    }


def lost_word(photo: PhotoReport) -> str:
    """A word for why a photo gave no corners."""
    from cubicfish.judge import Code

    why = photo.refusal.code if photo.refusal is not None else None
    if why in (Code.OTHER_SIZE, Code.CANNOT_BE_READ):
        return "another size" if why == Code.OTHER_SIZE else "cannot be read"
    return "left out" if why is None else "nothing found"


def why_lost(detection: Detection | None) -> dict[str, str]:
    """Photos that gave nothing, and a word for why."""
    photos = () if detection is None else detection.photos
    return {photo.name: lost_word(photo) for photo in photos if photo.lost}


def fitted_rows(
    known: CameraFacts,
    by_board: ByBoard,
    lost: Mapping[str, str],
) -> list[PhotoRow]:
    """Rows of photos with reprojection errors, and of those that take no part.

    Args:
        known: a camera, with the record of photos that were placed and of corners left out.
        by_board: corners used, by photo and board.
        lost: photos that take no part, and a word for why.

    """
    from cubicfish_cli.words.camera import photo_words
    from cubicfish_cli.words.sentences import render_short

    out = Counter(corner.image for corner in known.fit.dropped_corners)
    rows = [
        PhotoRow(
            name=one.image,
            words=photo_words(judged.reasons),
            short="; ".join(map(render_short, judged.reasons)),
            level=judged.level,
            boards=by_board.get(one.image, {}),
            corners=one.corners,
            dropped=out[one.image],
            errors=one,
        )
        for one, judged in zip(known.fit.per_image, known.photo_verdicts, strict=True)
    ]
    named = {row.name for row in rows}
    rows += [
        PhotoRow(name=name, words=why, level="bad", dropped=out[name])
        for name, why in lost.items()
        if name not in named
    ]
    return rows


def print_photo_table(
    rows: Sequence[PhotoRow],
    boards: Sequence[str],
    *,
    everything: str = "--json",
    apart: bool = False,
    fold: bool = False,
) -> None:
    """Print one row per photo.

    Args:
        rows: the photos.
        boards: names of the boards, in the target's order.
        everything: where all photos are, for who sees a few of them.
        apart: whether something stands before it; on a terminal something does in any case.
        fold: whether good photos are counted, and only the worst of them shown, unless all is
            wanted (``--verbose``).

    """
    room = columns_of(sys.stdout)
    width = room or _ROOMY
    if apart or room is not None:
        result()
    good = sum(row.level == "good" for row in rows)
    chosen = list(rows)
    if verbosity() <= 0 and (fold or room is not None):
        most = len(rows) - good + _MOST_GOOD if fold else _MOST_ROWS
        chosen = _find_worst(rows, min(most, _MOST_ROWS))
    if width < _ROOMY:
        chosen = [row.in_short() for row in chosen]
    columns = _choose_columns(rows, boards, width)
    print_table(
        list(columns),
        [[cell(row) for cell in columns.values()] for row in chosen],
        styles=[row.level for row in chosen],
    )
    if len(chosen) < len(rows):
        result(f"\n{_count_good(len(rows), good)}; all of them: -v, or {everything}")


def _find_worst(rows: Sequence[PhotoRow], most: int) -> list[PhotoRow]:
    """Find the worst rows, and say so where these are not all."""
    if len(rows) <= most:
        return list(rows)
    result(f"The worst of {len(rows):,} photos:\n")
    return sorted(rows, key=_rank_badness)[:most]


def _count_good(photos: int, good: int) -> str:
    return f"{plural(good, 'photo')} good" if good else f"{plural(photos, 'photo')}, none good"


def _rank_badness(row: PhotoRow) -> tuple[int, float]:
    return _RANK[row.level], 0.0 if math.isnan(row.rms_px) else -row.rms_px


def _choose_columns(
    rows: Sequence[PhotoRow], boards: Sequence[str], width: int
) -> dict[str, Callable[[PhotoRow], str]]:
    """The titles of the table's columns that so wide a terminal has, and what their cells say."""
    with_errors = any(math.isfinite(row.rms_px) for row in rows)
    with_dropped = any(row.dropped for row in rows)
    room_for_boards = _WIDE if len(boards) <= _FEW_BOARDS else _ROOMY
    columns: list[tuple[str, int, Callable[[PhotoRow], str]]] = [
        ("photo", 0, lambda row: row.name),
        ("corners", _NARROW * with_errors, _write_corners),
        *((board, room_for_boards, partial(_describe_board, board=board)) for board in boards),
        *[("dropped", _NARROW, lambda row: str(row.dropped or "-"))] * with_dropped,
        *_ERROR_COLUMNS * with_errors,
        ("verdict", 0, lambda row: row.words),
    ]
    return {title: cell for title, least, cell in columns if width >= least}


def _write_corners(row: PhotoRow) -> str:
    return "-" if row.corners is None else str(row.corners)


def _write_error(row: PhotoRow, name: str) -> str:
    return "-" if row.errors is None else px(getattr(row.errors, name))


_ERROR_COLUMNS: list[tuple[str, int, Callable[[PhotoRow], str]]] = [
    ("rms px", 0, lambda row: px(row.rms_px)),
    ("median", _ROOMY, partial(_write_error, name="median_px")),
    ("95 %", _ROOMY, partial(_write_error, name="p95_px")),
    ("largest", _NARROW, partial(_write_error, name="max_px")),
]
"""The columns of errors: title, the least width of a terminal that has it, what a cell says."""


def _describe_board(row: PhotoRow, board: str) -> str:
    return str(row.boards.get(board, "-"))
