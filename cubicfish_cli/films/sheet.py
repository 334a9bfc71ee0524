"""The contact sheet: chosen frames, small and side by side, in one page.

It is no picture, since a folder's pictures are the photos to calibrate from.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import PhotoError
from cubicfish_cli.photos import Picture, read_picture

NAME = "contact_sheet.html"
_WIDTH, _QUALITY = 240, 80
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


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A picture of the page.

    Attributes:
        path: its file.
        head: what stands out below it.
        words: what is said of it besides.

    """

    path: Path
    head: str
    words: str


def sheet(
    title: str,
    about: str,
    frames: Iterable[Shown],
    corners: npt.NDArray[np.float64],
    size: tuple[int, int],
) -> str:
    """The page.

    Args:
        title: its heading.
        about: what is said of all frames.
        frames: the pictures.
        corners: (N, 2) pixels of the corners in all of them.
        size: (width, height) of them.

    Raises:
        PhotoError: a picture cannot be read.

    """
    figures = [
        _figure(_map(corners, size), "All corners", "of the chosen frames, seen at a glance")
    ]
    for one in frames:
        image = f'<img alt="" src="data:image/jpeg;base64,{_small(one.path)}">'
        figures.append(_figure(image, one.head, one.words))
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


def _small(path: Path) -> str:
    picture: Picture = read_picture(path)
    height, width = picture.shape[:2]
    size = (min(width, _WIDTH), max(1, round(height * min(1.0, _WIDTH / width))))
    done, data = cv2.imencode(
        ".jpg",
        cv2.resize(picture, size, interpolation=cv2.INTER_AREA),
        [cv2.IMWRITE_JPEG_QUALITY, _QUALITY],
    )
    if not done:
        raise PhotoError(f"{path} cannot be shown small")
    return b64encode(data.tobytes()).decode()
