"""Writing the chosen frames of films and the contact sheet, all or none.

The sheet is no picture file, since a folder's pictures are the photos to calibrate from.
"""

from functools import partial
from html import escape
from pathlib import Path

from cubicfish.files import Content, FrameName
from cubicfish_cli.extensions.films.frames import Chosen, names_of
from cubicfish_cli.films.scan import copy_as_png
from cubicfish_cli.plan import Plan
from cubicfish_cli.render.small_pictures import data_uri, thumbnail
from cubicfish_cli.words.phrases import plural

SHEET = "contact_sheet.html"
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


def write_chosen(folder: Path, chosen: Chosen, plan: Plan) -> None:
    """Write the sheet and pictures; remove pictures of an earlier choice of these films.

    Args:
        folder: the folder.
        chosen: the chosen frames.
        plan: what is read and written.

    Raises:
        OutputError: a file exists and may not be replaced, or cannot be written.

    """
    files: dict[Path, Content] = {folder / SHEET: _draw_sheet(chosen)}
    for frame in chosen.taken:
        files[folder / frame.photo.name] = partial(copy_as_png, frame.photo)
    films = {one.film.label for one in chosen.measured}
    pictures = folder.glob("*.png")
    plan.leaves(*(one for one in pictures if (FrameName.read(one.name) or ("",))[0] in films))
    plan.write(files)


def _draw_sheet(chosen: Chosen) -> str:
    """Make the contact sheet: chosen frames, small and side by side, in one page."""
    films, taken = chosen.measured, chosen.taken
    figures = []
    for frame in taken:
        seen, film = frame.seen, films[frame.film]
        picture = data_uri(thumbnail(frame.photo.read(), _LONGEST), _QUALITY)
        head = f"{film.film.label} " * (len(films) > 1) + f"{film.time[frame.index]:.3f} s"
        figures.append(
            f'<figure><img alt="" src="{picture}"><figcaption><b>{escape(head)}</b><br>'
            f"{seen.corners} corners, sharpness {seen.sharpness:.2f}, motion {seen.motion:.1f} px, "
            f"gain {frame.gain:.2f}</figcaption></figure>"
        )
    title = f"{plural(len(taken), 'frame')} of {names_of(films)}"
    about = (
        f"Chosen of {sum(map(len, films)):,} frames; boards were looked for in "
        f"{chosen.looked_at:,}. Gain is what a frame added to those chosen before it."
    )
    return _PAGE.format(title=escape(title), about=escape(about), figures="\n".join(figures))
