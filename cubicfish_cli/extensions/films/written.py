"""What is written of films: the chosen frames, frames.csv and the contact sheet, all or none.

frames.csv has every frame, its measures, and whether it was chosen. The sheet is no picture, since
a folder's pictures are the photos to calibrate from.
"""

from __future__ import annotations

import csv
import math
import shutil
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from cubicfish_cli.app.photos import data_uri, read_picture, thumbnail
from cubicfish_cli.app.words.phrases import plural
from cubicfish_cli.core.files import whole_files, write_text
from cubicfish_cli.core.tables import csv_text
from cubicfish_cli.extensions.films.frames import Chosen, listed

TABLE, SHEET = "frames.csv", "contact_sheet.html"
COLUMNS = ("film", "time", "sharpness", "motion", "corners", "gain", "chosen", "photo")
PASSED_OVER = "not looked at: a neighbour is sharper or stiller"
_MARK = "# cubicfish frames 1\n"
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
figure {{ margin: 0; }} img {{ width: 100%; display: block; }}
figcaption {{ overflow-wrap: anywhere; margin-top: .3em; }}
</style></head><body><h1>{title}</h1><p>{about}</p><main>
{figures}
</main></body></html>
"""


def write_chosen(folder: Path, chosen: Chosen, *, overwrite: bool) -> None:
    """Write table, sheet and pictures; pictures of an earlier choice go.

    Args:
        folder: where.
        chosen: what was chosen.
        overwrite: whether files of an earlier choice may be replaced.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, or cannot be written.

    """
    names = [frame.photo.name for frame in chosen.taken]
    paths = [folder / name for name in (TABLE, SHEET, *names)]
    old = [folder / name for name in _photos_of_table(paths[0])] if overwrite else []
    obsolete = [path for path in old if path not in paths]
    written = whole_files(paths, overwrite=overwrite, obsolete=obsolete, folder=folder)
    with written as (table, page, *pictures):
        write_text(table, _MARK + csv_text((COLUMNS, *_rows(chosen))), overwrite=False)
        for picture, frame in zip(pictures, chosen.taken, strict=True):
            shutil.copyfile(frame.photo.path, picture)
        write_text(page, _sheet(chosen, pictures), overwrite=False)


def _rows(chosen: Chosen) -> Iterator[tuple[object, ...]]:
    """All frames of the films, one after the other."""
    candidates = {(frame.film, frame.index): frame for frame in chosen.frames}
    for number, film in enumerate(chosen.measured):
        measures = zip(film.time, film.sharpness, film.motion, strict=True)
        for index, (time, sharp, moved) in enumerate(measures):
            row = (film.film.path, f"{time:.6f}", f"{sharp:.4f}", f"{moved:.3f}")
            frame = candidates.get((number, index))
            if frame is None:
                yield (*row, "", "", PASSED_OVER, "")
                continue
            known = frame.gain is not None and math.isfinite(frame.gain)
            corners = "" if frame.gain is None else frame.seen.corners
            gain = f"{frame.gain:.3f}" if known else ""
            photo = "" if frame.why_not else frame.photo.name
            yield (*row, corners, gain, frame.why_not or "yes", photo)


def _photos_of_table(path: Path) -> list[str]:
    """Names of the pictures that were written beside a table; none where it cannot be read.

    A name that leads out of the folder is no name of a picture.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            if not file.readline(len(_MARK)).startswith(_MARK):
                return []
            names = [row.get("photo") or "" for row in csv.DictReader(file)]
    except (OSError, ValueError, csv.Error):
        return []
    return [name for name in names if Path(name).name == name and name.endswith(".png")]


def _sheet(chosen: Chosen, pictures: Sequence[Path]) -> str:
    """The contact sheet: chosen frames, small and side by side, in one page."""
    films, taken = chosen.measured, chosen.taken
    figures = []
    for frame, path in zip(taken, pictures, strict=True):
        seen, film = frame.seen, films[frame.film]
        picture = data_uri(thumbnail(read_picture(path), _LONGEST), _QUALITY)
        head = f"{film.film.label} " * (len(films) > 1) + f"{film.time[frame.index]:.3f} s"
        figures.append(
            f'<figure><img alt="" src="{picture}"><figcaption><b>{escape(head)}</b><br>'
            f"{seen.corners} corners, sharpness {seen.sharpness:.2f}, motion {seen.motion:.1f} px, "
            f"gain {frame.gain:.2f}</figcaption></figure>"
        )
    title = f"{plural(len(taken), 'frame')} of {listed(films)}"
    about = (
        f"Chosen of {sum(map(len, films)):,} frames; boards were looked for in "
        f"{chosen.looked_at:,}. Gain is what a frame added to those chosen before it. frames.csv "
        "says of every frame why it was not chosen."
    )
    return _PAGE.format(title=escape(title), about=escape(about), figures="\n".join(figures))
