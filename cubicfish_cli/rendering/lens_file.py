"""Lens files: the exact formula of a made-up lens as YAML.

A lens from outside the fitted families is stated by its name; the centre and the distance beside it
say as which lens of rays it is compared with others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.lenses.asymmetric import AsymmetricLens
from cubicfish_cli.plain_yaml import load_plain_yaml, plain_yaml_text
from cubicfish_cli.rendering.outside import OUTSIDE_LENSES, RaysAtDistance, outside_lens
from cubicfish_cli.wording import did_you_mean, quoted

_COUNTS = {
    "image_size": 2,
    "fx": 0,
    "fy": 0,
    "cx": 0,
    "cy": 0,
    "k": 4,
    "p": 2,
    "tilt": 2,
    "max_angle_deg": 0,
}  # how many numbers a key holds; 0 for a number alone
_NEEDED = ("image_size", "fx", "fy", "cx", "cy")
_OUTSIDE = ("lens", "image_size", "units", "centre", "distance")
_MOST = 1e6
_MAX_SIDE = 100_000
_LARGEST = 20_000  # bytes; a formula is a few hundred


def is_lens_file(path: Path) -> bool:
    """Whether a readable YAML file holds a formula, and not a calibrated camera."""
    try:
        if path.stat().st_size > _LARGEST:
            return False
    except OSError:
        pass  # said by whoever reads it
    data = load_plain_yaml(path, error=CameraFileError)
    if not isinstance(data, dict) or "cubicfish" in data:
        return False
    return "lens" in data or {"fx", "fy"} <= data.keys()


def load_lens(path: Path) -> AsymmetricLens | RaysAtDistance:
    """Read a lens file.

    Raises:
        CameraFileError: the file is malformed, or no lens has these numbers; one line that names
            the file and the key.

    """
    data = load_plain_yaml(path, error=CameraFileError)
    if not isinstance(data, dict):
        raise CameraFileError(f"{path} must hold the keys {', '.join(_COUNTS)}")
    if "lens" in data:
        return _outside(path, data)
    _check_keys(path, data, tuple(_COUNTS), _NEEDED, "a lens")
    values = {key: _numbers(path, key, value) for key, value in data.items()}
    values["image_size"] = _size(path, values["image_size"])
    if values["fx"] <= 0 or values["fy"] <= 0:
        raise CameraFileError(f"{path}: fx and fy must be above 0")
    if not 0 < values.get("max_angle_deg", 95.0) < 180:
        raise CameraFileError(f"{path}: max_angle_deg must be between 0 and 180")
    try:
        return AsymmetricLens(**values)
    except ValueError as problem:  # a profile that folds
        raise CameraFileError(f"{path}: {problem}") from problem


def lens_text(lens: AsymmetricLens | RaysAtDistance) -> str:
    """A lens file that :func:`load_lens` reads back exactly."""
    if isinstance(lens, RaysAtDistance):
        return plain_yaml_text(
            {
                "lens": lens.lens.name,
                "image_size": list(lens.image_size),
                "units": lens.lens.units,
                "centre": lens.centre,
                "distance": lens.distance,
            }
        )
    return plain_yaml_text(
        {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in asdict(lens).items()
        }
    )


def _outside(path: Path, data: dict[str, Any]) -> RaysAtDistance:
    _check_keys(path, data, _OUTSIDE, _OUTSIDE, "such a lens")
    if data["lens"] not in OUTSIDE_LENSES:
        raise CameraFileError(f"{path}: lens must be one of {', '.join(OUTSIDE_LENSES)}")
    if not isinstance(data["units"], str):
        raise CameraFileError(f"{path}: units must be a word such as mm")
    values = {key: _numbers(path, key, data[key]) for key in ("image_size", "centre", "distance")}
    if values["distance"] <= 0:
        raise CameraFileError(f"{path}: distance must be above 0")
    lens = outside_lens(data["lens"], _size(path, values["image_size"]), units=data["units"])
    return RaysAtDistance(lens=lens, centre=values["centre"], distance=values["distance"])


def _check_keys(
    path: Path, data: dict[str, Any], known: Sequence[str], needed: Sequence[str], what: str
) -> None:
    for key in map(str, data):
        if key not in known:
            raise CameraFileError(f"{path}: unknown key {quoted(key)}: {did_you_mean(key, known)}")
    for key in needed:
        if key not in data:
            raise CameraFileError(f"{path}: {key} is missing: {what} has {', '.join(needed)}")


def _size(path: Path, size: tuple[float, float]) -> tuple[int, int]:
    if not all(side == int(side) and 0 < side <= _MAX_SIDE for side in size):
        raise CameraFileError(f"{path}: image_size must be two whole numbers above 0")
    return int(size[0]), int(size[1])


def _numbers(path: Path, key: str, value: Any) -> Any:
    count = _COUNTS.get(key, 0)
    items = value if isinstance(value, list) else [value]
    if (
        isinstance(value, list) != bool(count)
        or len(items) != max(count, 1)
        or not all(
            isinstance(item, int | float) and not isinstance(item, bool) and abs(item) <= _MOST
            for item in items
        )
    ):
        wanted = f"{count} numbers" if count else "a number"
        raise CameraFileError(f"{path}: {key} must be {wanted}, each within ±{_MOST:g}")
    return tuple(float(item) for item in items) if count else float(value)
