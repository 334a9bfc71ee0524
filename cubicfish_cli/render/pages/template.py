"""The template that pages are filled into."""

import math
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

_LONGEST_TEXT = 1000
_IMAGES = ("data:image/jpeg;base64,", "data:image/svg+xml;base64,")
_HERE = Path(__file__).parent


@cache
def template(page: Path) -> Any:
    """Load one of the package's pages, which have style and figures in common."""
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_make_printable,
        optimized=False,  # a page is filled once
    )
    environment.filters["px"] = _write_px
    environment.filters["count"] = _count
    environment.globals["style"] = (_HERE / "page.css").read_text(encoding="utf-8")
    texts = [one.read_text(encoding="utf-8") for one in (_HERE / "parts.html", page)]
    return environment.from_string("".join(texts))


def _make_printable(value: Any) -> Any:
    """Return untrusted text, such as a name, on one line and without control characters."""
    if not isinstance(value, str) or hasattr(value, "__html__"):  # the package's own markup
        return value
    if value.startswith(_IMAGES):
        return value
    if len(value) > _LONGEST_TEXT:
        value = value[: _LONGEST_TEXT - 1] + "…"
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in value)


def _write_px(value: float | None, places: int = 3) -> str:
    return "–" if value is None or math.isnan(value) else f"{value:.{places}f}"


def _count(value: float) -> str:
    return f"{value:,.0f}"
