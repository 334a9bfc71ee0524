"""Values of records that came from files nobody vouches for, each refused in a line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.types import FloatArray
from cubicfish_cli.wording import did_you_mean, quoted

MAX_SIDE = 100_000
_LARGEST = 1e100


def mapping(path: Path | str, value: Any, what: str) -> dict[str, Any]:
    """A record, or an error that says what it should be."""
    if not isinstance(value, dict):
        raise CameraFileError(f"{path}: {what} must hold keys and values")
    return value


def numbers(path: Path, value: Any, key: str, counts: tuple[int, ...]) -> FloatArray:
    """A list of finite numbers, as many as one of ``counts``."""
    if (
        not isinstance(value, list)
        or len(value) not in counts
        or not all(isinstance(one, int | float) and not isinstance(one, bool) for one in value)
        or not all(abs(one) < _LARGEST for one in value)  # NaN fails this too
    ):
        wanted = " or ".join(map(str, counts))
        raise CameraFileError(f"{path}: {key} must hold {wanted} finite numbers")
    return np.array(value, float)


def number(path: Path, record: dict[str, Any], key: str) -> float:
    """One finite number."""
    return float(numbers(path, [record.get(key)], key, (1,))[0])


def focal(path: Path, values: FloatArray, key: str) -> FloatArray:
    """Focal lengths, which must be above 0."""
    if not (values > 0).all():
        raise CameraFileError(f"{path}: {key}: focal lengths must be above 0")
    return values


def refuse_unknown(path: Path, record: Mapping[Any, Any], keys: Iterable[str]) -> None:
    """Refuse a record that has another key."""
    keys = tuple(keys)
    for key in map(str, record):
        if key not in keys:
            raise CameraFileError(f"{path}: unknown key {quoted(key)}: {did_you_mean(key, keys)}")


def refuse_version(path: Path, found: Any, version: int) -> None:
    """Refuse a file of our own of another version."""
    if found != version or isinstance(found, bool):
        raise CameraFileError(
            f"{path}: format version {found!r} is not {version}: read it with the version of "
            "cubicfish that wrote it, or calibrate again"
        )


def size(path: Path, width: Any, height: Any, key: str) -> tuple[int, int]:
    """(width, height) in pixels."""
    for side in (width, height):
        if isinstance(side, bool) or not isinstance(side, int | float) or side != side:
            raise CameraFileError(f"{path}: {key} must be two whole numbers")
        if not 1 <= side <= MAX_SIDE or side != int(side):
            raise CameraFileError(f"{path}: {key} must be two whole numbers from 1 to {MAX_SIDE}")
    return int(width), int(height)
