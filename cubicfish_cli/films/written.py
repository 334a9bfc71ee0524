"""Writing the chosen frames, frames.csv and the contact sheet together or not at all."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.files import whole_files, write_text
from cubicfish_cli.films.candidates import Candidate
from cubicfish_cli.films.choose import Seen
from cubicfish_cli.films.raw import load_frame
from cubicfish_cli.films.scan import Measured
from cubicfish_cli.films.sheet import NAME as SHEET
from cubicfish_cli.films.sheet import Shown, sheet
from cubicfish_cli.films.table import NAME as TABLE
from cubicfish_cli.films.table import FrameRow, photos_of_table, write_rows
from cubicfish_cli.films.write import write_frame
from cubicfish_cli.photos import shown

PASSED_OVER = "not looked at: a neighbour is sharper or stiller"
_MOST_NAMED = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """What became of films' frames.

    Attributes:
        measured: a record a film.
        frames: those that might be chosen.
        looked_at: numbers of those that were looked at.
        seen, gain: what each of ``frames`` shows and adds, where it was looked at.
        why_not: why each was not chosen; "" for those that were.

    """

    measured: Sequence[Measured]
    frames: Sequence[Candidate]
    looked_at: frozenset[int]
    seen: Sequence[Seen]
    gain: npt.NDArray[np.float64]
    why_not: Sequence[str]

    @property
    def numbers(self) -> list[int]:
        """Numbers of the frames that were chosen, in the films' order."""
        return [at for at, why in enumerate(self.why_not) if not why]

    def rows(self) -> Iterator[FrameRow]:
        """All frames of the films, one after the other."""
        place = {(frame.film, frame.index): at for at, frame in enumerate(self.frames)}
        for number, film in enumerate(self.measured):
            for index in range(len(film)):
                at = place.get((number, index))
                looked_at = at in self.looked_at
                gain = math.nan if at is None or not looked_at else float(self.gain[at])
                yield FrameRow(
                    film=str(film.film.path),
                    time=film.time[index],
                    sharpness=film.sharpness[index],
                    motion=film.motion[index],
                    corners=None if at is None or not looked_at else self.seen[at].corners,
                    gain=gain if math.isfinite(gain) else None,
                    why_not=PASSED_OVER if at is None else self.why_not[at],
                    photo="" if at is None or self.why_not[at] else self.frames[at].name,
                )


def write_chosen(folder: Path, of: Mapping[str, Any], chosen: Chosen, *, overwrite: bool) -> None:
    """Write table, sheet and pictures; pictures of an earlier choice go.

    Args:
        folder: where.
        of: what the choice depends on; see :func:`cubicfish_cli.films.table.depends_on`.
        chosen: what was chosen.
        overwrite: whether files of an earlier choice may be replaced.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, or cannot be written.

    """
    frames = [chosen.frames[at] for at in chosen.numbers]
    paths = [folder / name for name in (TABLE, SHEET, *(frame.name for frame in frames))]
    old = [folder / name for name in photos_of_table(paths[0])] if overwrite else []
    obsolete = [path for path in old if path not in paths]
    with whole_files(paths, overwrite=overwrite, obsolete=obsolete) as (table, page, *pictures):
        write_rows(table, of, chosen.rows())
        for picture, frame in zip(pictures, frames, strict=True):
            write_frame(picture, load_frame(frame.path))
        write_text(page, _sheet(chosen, pictures), overwrite=False)


def _sheet(chosen: Chosen, pictures: Sequence[Path]) -> str:
    numbers = chosen.numbers
    every = sum(len(film) for film in chosen.measured)
    several = len(chosen.measured) > 1
    frames = []
    for at, path in zip(numbers, pictures, strict=True):
        frame, seen = chosen.frames[at], chosen.seen[at]
        film = chosen.measured[frame.film]
        frames.append(
            Shown(
                path=path,
                head=f"{film.film.label} " * several + f"{film.time[frame.index]:.3f} s",
                words=f"{seen.corners} corners, sharpness {seen.sharpness:.2f}, motion "
                f"{seen.motion:.1f} px, gain {chosen.gain[at]:.2f}",
            )
        )
    return sheet(
        f"{len(numbers)} frame{'s' * (len(numbers) != 1)} of {listed(chosen.measured)}",
        f"Chosen of {every:,} frames; boards were looked for in {len(chosen.looked_at):,}. Gain is "
        "what a frame added to those chosen before it. frames.csv says of every frame why it was "
        "not chosen.",
        frames,
        np.concatenate([chosen.seen[at].pixel for at in numbers]),
        chosen.measured[0].film.size,
    )


def listed(films: Sequence[Measured]) -> str:
    """The films' names, the first of many."""
    names = [shown(one.film.path.name) for one in films]
    return ", ".join(names[:_MOST_NAMED]) + f" and {len(names) - _MOST_NAMED} more" * (
        len(names) > _MOST_NAMED
    )
