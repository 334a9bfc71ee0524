"""Places in the picture, lengths and tilts in a photographer's words."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.angles import angle_from_axis, azimuth
from cubicfish_cli.types import FloatArray, IntArray

# Clockwise from the right, y down, an eighth of a turn each.
SIDES = (
    "right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right",
)  # fmt: skip
_MIDDLE_DEG = 12.0
# Below this slant a face looks at the camera.
_FACING_DEG = 12.0
_METRES = {"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0, "um": 1e-6, "µm": 1e-6}


def side_of(offset: FloatArray) -> IntArray:
    """Which eighth of the picture offsets (..., 2) from the axis lie in, an index of SIDES."""
    turn = azimuth(offset)
    eighth: IntArray = np.rint(turn / (np.pi / 4)).astype(np.intp) % 8
    return eighth


def place_words(ray: FloatArray) -> str:
    """Where in the picture a ray (3,) is: ``in the lower right of the picture, 52° ...``."""
    angle = float(np.degrees(angle_from_axis(ray)))
    if angle < _MIDDLE_DEG:
        return "in the middle of the picture"
    side = SIDES[int(side_of(ray[:2]))]
    word = {"bottom": "at", "top": "at", "left": "on", "right": "on"}.get(side, "in")
    return f"{word} the {side} of the picture, {angle:.0f}° from the axis"


def length_words(length: float, units: str) -> str:
    """A length to two digits in a unit that suits it: ``40 cm``; others are left as they are."""
    if length <= 0:
        return f"0 {units}"
    factor = _METRES.get(units)
    if factor is None:
        return f"{_two_digits(length)} {units}"
    metres = length * factor
    for name, size, least in (("m", 1.0, 1.0), ("cm", 0.01, 0.02), ("mm", 1e-3, 0.0)):
        if metres >= least:
            return f"{_two_digits(metres / size)} {name}"
    return f"{_two_digits(length)} {units}"


def _two_digits(value: float) -> str:
    digits = 1 - int(np.floor(np.log10(value)))
    return f"{round(value, digits):.{max(0, digits)}f}"


def across(middle: FloatArray) -> FloatArray:
    """(..., 2, 3) unit vectors to the right and down in the picture, across rays (..., 3).

    The camera's own x and y, turned along with its axis to the ray the short way.
    """
    ray = middle / np.linalg.norm(middle, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(ray, -1, 0)
    share = 1 / np.maximum(1 + z, 1e-9)
    right = np.stack([1 - x * x * share, -x * y * share, -x], axis=-1)
    down = np.stack([-x * y * share, 1 - y * y * share, -y], axis=-1)
    return np.stack([right, down], axis=-2)


def slant(front: FloatArray, middle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How faces are tilted: degrees (...), and towards where in the picture (..., 2), unit.

    Args:
        front: (..., 3) where the faces look, unit vectors in the camera frame.
        middle: (..., 3) where they are.

    """
    ray = middle / np.linalg.norm(middle, axis=-1, keepdims=True)
    cosine = np.clip(-(front * ray).sum(axis=-1), -1, 1)
    towards = (across(middle) @ front[..., None])[..., 0]
    length = np.linalg.norm(towards, axis=-1, keepdims=True)
    return np.degrees(np.arccos(cosine)), towards / np.maximum(length, 1e-12)


def tilt_words(front: FloatArray, middle: FloatArray) -> str:
    """``its face turned 35° to the left`` (its left edge is then the farther one), or facing."""
    angle, towards = slant(front, middle)
    if angle < _FACING_DEG:
        return "facing the camera"
    side = SIDES[int(side_of(towards))]
    where = {"bottom": "downwards", "top": "upwards"}.get(side, f"to the {side}")
    return f"its face turned {float(angle):.0f}° {where}"


def listed(words: list[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
