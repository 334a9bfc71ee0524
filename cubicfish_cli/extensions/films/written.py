"""What is written of films: the chosen frames, frames.csv and the contact sheet, all or none.

frames.csv has every frame, its measures, and whether it was chosen. The sheet is no picture, since
a folder's pictures are the photos to calibrate from.
"""

from __future__ import annotations

import csv
import json
import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from os.path import realpath
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli import __version__
from cubicfish_cli.app.films.choose import Seen
from cubicfish_cli.app.films.scan import Measured
from cubicfish_cli.app.films.source import Film
from cubicfish_cli.app.photos import data_uri, read_picture, shown, thumbnail
from cubicfish_cli.core.files import whole_files, write_text
from cubicfish_cli.extensions.films.candidates import Candidate

TABLE, SHEET = "frames.csv", "contact_sheet.html"
COLUMNS = ("film", "time", "sharpness", "motion", "corners", "gain", "chosen", "photo")
PASSED_OVER = "not looked at: a neighbour is sharper or stiller"
_MARK = "# cubicfish frames 1, "
_FIRST_BYTES = 1_000_000
_MOST_NAMED = 4
_LONGEST, _QUALITY = 240, 80
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Chosen frames</title>
<meta name="viewport" content="width=device-width">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; \
style-src 'unsafe-inline'">
<style>
:root {{ color-scheme: light dark; }}
body {{ font: 13px/1.4 system-ui, sans-serif; margin: 1em; }}
h1 {{ font-size: 20px; margin: 0 0 .3em; }} p {{ margin: 0 0 1.2em; max-width: 60em; }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(240px, 1fr)); gap: 1em; }}
figure {{ margin: 0; }} img, svg {{ width: 100%; display: block; background: #000; }}
figcaption {{ overflow-wrap: anywhere; margin-top: .3em; }}
path {{ stroke: #4fc3f7; stroke-linecap: round; }}
</style></head><body><h1>{title}</h1><p>{about}</p><main>
{figures}
</main></body></html>
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """What became of films' frames.

    Attributes:
        measured: a record a film.
        frames: those that might be chosen.
        looked_at: numbers of those that were looked at.
        seen, gain: what each of ``frames`` shows and adds, where it was looked at.
        why_not: why each was not chosen; "" for those that were.
        ended: why no more were chosen, in a sentence.

    """

    measured: Sequence[Measured]
    frames: Sequence[Candidate]
    looked_at: frozenset[int]
    seen: Sequence[Seen]
    gain: npt.NDArray[np.float64]
    why_not: Sequence[str]
    ended: str

    @property
    def numbers(self) -> list[int]:
        """Numbers of the frames that were chosen, in the films' order."""
        return [at for at, why in enumerate(self.why_not) if not why]


def write_chosen(folder: Path, of: Mapping[str, Any], chosen: Chosen, *, overwrite: bool) -> None:
    """Write table, sheet and pictures; pictures of an earlier choice go.

    Args:
        folder: where.
        of: what the choice depends on; see :func:`depends_on`.
        chosen: what was chosen.
        overwrite: whether files of an earlier choice may be replaced.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, or cannot be written.

    """
    frames = [chosen.frames[at] for at in chosen.numbers]
    paths = [folder / name for name in (TABLE, SHEET, *(frame.photo.name for frame in frames))]
    old = [folder / name for name in photos_of_table(paths[0])] if overwrite else []
    obsolete = [path for path in old if path not in paths]
    written = whole_files(paths, overwrite=overwrite, obsolete=obsolete, folder=folder)
    with written as (table, page, *pictures):
        _write_table(table, of, chosen)
        for picture, frame in zip(pictures, frames, strict=True):
            shutil.copyfile(frame.photo.path, picture)
        write_text(page, _sheet(chosen, pictures), overwrite=False)


def _write_table(path: Path, of: Mapping[str, Any], chosen: Chosen) -> None:
    """All frames of the films, one after the other."""
    place = {(frame.film, frame.index): at for at, frame in enumerate(chosen.frames)}
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{_MARK}{json.dumps({**of, 'ended': chosen.ended})}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for number, film in enumerate(chosen.measured):
            for index in range(len(film)):
                at = place.get((number, index))
                corners, gain, why_not, photo = "", "", PASSED_OVER, ""
                if at is not None:
                    why_not = chosen.why_not[at]
                    photo = "" if why_not else chosen.frames[at].photo.name
                    if at in chosen.looked_at:
                        corners, value = str(chosen.seen[at].corners), float(chosen.gain[at])
                        gain = f"{value:.3f}" if math.isfinite(value) else ""
                writer.writerow(
                    (
                        film.film.path,
                        f"{film.time[index]:.6f}",
                        f"{film.sharpness[index]:.4f}",
                        f"{film.motion[index]:.3f}",
                        corners,
                        gain,
                        why_not or "yes",
                        photo,
                    )
                )


def photos_of_table(path: Path) -> list[str]:
    """Names of the pictures that were written beside a table; none where it cannot be read.

    A name that leads out of the folder is no name of a picture.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            if not file.readline(_FIRST_BYTES).startswith(_MARK):
                return []
            names = [row.get("photo") or "" for row in csv.DictReader(file)]
    except (OSError, ValueError, csv.Error):
        return []
    return [name for name in names if name and Path(name).name == name and name.endswith(".png")]


def depends_on(films: Sequence[Film], most: int, target_sha256: str | None) -> dict[str, Any]:
    """What a choice depends on: the films as they are now, how many may be chosen, the target."""
    return {
        "films": [[realpath(film.path), *film.stamp] for film in films],
        "most": most,
        "target": target_sha256,
        "version": __version__,
    }


def ended_of(path: Path, of: Mapping[str, Any]) -> str | None:
    """Why a table has no more frames; None where its choice did not depend on just this."""
    try:
        with path.open(encoding="utf-8") as file:
            line = file.readline(_FIRST_BYTES)
        made = json.loads(line.removeprefix(_MARK))
        ended = made.pop("ended")
    except (OSError, ValueError, AttributeError, LookupError, TypeError):
        return None
    return str(ended) if line.startswith(_MARK) and made == of else None


def _sheet(chosen: Chosen, pictures: Sequence[Path]) -> str:
    """The contact sheet: chosen frames, small and side by side, in one page."""
    numbers = chosen.numbers
    every = sum(len(film) for film in chosen.measured)
    several = len(chosen.measured) > 1
    corners = np.concatenate([chosen.seen[at].pixel for at in numbers])
    drawn = _map(corners, chosen.measured[0].film.size)
    figures = [_figure(drawn, "All corners", "of the chosen frames, seen at a glance")]
    for at, path in zip(numbers, pictures, strict=True):
        frame, seen = chosen.frames[at], chosen.seen[at]
        film = chosen.measured[frame.film]
        figures.append(
            _figure(
                f'<img alt="" src="{data_uri(thumbnail(read_picture(path), _LONGEST), _QUALITY)}">',
                f"{film.film.label} " * several + f"{film.time[frame.index]:.3f} s",
                f"{seen.corners} corners, sharpness {seen.sharpness:.2f}, motion "
                f"{seen.motion:.1f} px, gain {chosen.gain[at]:.2f}",
            )
        )
    title = f"{len(numbers)} frame{'s' * (len(numbers) != 1)} of {listed(chosen.measured)}"
    about = (
        f"Chosen of {every:,} frames; boards were looked for in {len(chosen.looked_at):,}. Gain is "
        "what a frame added to those chosen before it. frames.csv says of every frame why it was "
        "not chosen."
    )
    return _PAGE.format(title=escape(title), about=escape(about), figures="\n".join(figures))


def _figure(image: str, head: str, words: str) -> str:
    caption = f"<figcaption><b>{escape(head)}</b><br>{escape(words)}</figcaption>"
    return f"<figure>{image}{caption}</figure>"


def _map(corners: npt.NDArray[np.float64], size: Sequence[int]) -> str:
    """Where corners (N, 2) are in the picture, as a drawing."""
    dots = "".join(f"M{x:.0f} {y:.0f}h0" for x, y in corners)
    width = max(1, round(size[0] / 120))
    box = f"0 0 {size[0]} {size[1]}"
    return f'<svg viewBox="{box}" role="img"><path stroke-width="{width}" d="{dots}"/></svg>'


def listed(films: Sequence[Measured]) -> str:
    """The films' names, the first of many."""
    names = [shown(one.film.path.name) for one in films]
    return ", ".join(names[:_MOST_NAMED]) + f" and {len(names) - _MOST_NAMED} more" * (
        len(names) > _MOST_NAMED
    )
