"""The contact sheet: chosen frames, small and side by side, in one page.

It is no picture, since a folder's pictures are the photos to calibrate from.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from pathlib import Path

import cv2

from cubicfish_cli.errors import PhotoError
from cubicfish_cli.photos import Picture, read_picture

NAME = "contact_sheet.html"
_WIDTH, _QUALITY = 240, 80
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Chosen frames</title>
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; \
style-src 'unsafe-inline'">
<style>
body {{ font: 13px system-ui, sans-serif; margin: 1em; background: Canvas; color: CanvasText; }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(240px, 1fr)); gap: 1em; }}
figure {{ margin: 0; }} img {{ width: 100%; }} figcaption {{ overflow-wrap: anywhere; }}
</style></head><body><h1>{title}</h1><main>
{figures}
</main></body></html>
"""


def sheet(title: str, frames: Iterable[tuple[Path, str]]) -> str:
    """The page.

    Args:
        title: its heading.
        frames: picture files, and what is said below each.

    Raises:
        PhotoError: a picture cannot be read.

    """
    figures = [
        f'<figure><img alt="" src="data:image/jpeg;base64,{_small(path)}">'
        f"<figcaption>{escape(words)}</figcaption></figure>"
        for path, words in frames
    ]
    return _PAGE.format(title=escape(title), figures="\n".join(figures))


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
