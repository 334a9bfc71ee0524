"""Bounded reading of text, JSON and values from untrusted files, with one-line errors."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.reading import read_bytes, read_text
from cubicfish_cli.types import FloatArray
from cubicfish_cli.wording import did_you_mean, quoted

MAX_SIDE = 100_000
_LARGEST = 1e100
MAX_VALUES = 2_000_000


def read_bounded(path: Path, *, max_bytes: int) -> str:
    """The text of a camera's file of at most ``max_bytes``; a byte order mark is dropped.

    Raises:
        CameraFileError: the file cannot be read, is larger, or is not UTF-8 text.

    """
    return read_text(path, max_bytes=max_bytes, error=CameraFileError)


def read_bounded_bytes(path: Path, *, max_bytes: int) -> bytes:
    """The contents of a camera's file of at most ``max_bytes``.

    Raises:
        CameraFileError: the file cannot be read, or is larger.

    """
    return read_bytes(path, max_bytes=max_bytes, error=CameraFileError)


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


def json_text(data: Any) -> str:
    """Plain data as the text of a file, finite numbers only."""
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def parse_plain_json(path: Path, text: str) -> Any:
    """What the text of a file holds; ``path`` is for messages.

    Raises:
        CameraFileError: it is not JSON, a key is there twice, a number is not one, or there are
            more than :data:`MAX_VALUES`; one line.

    """
    if sum(map(text.count, ",[{")) > MAX_VALUES:
        raise CameraFileError(
            f"{path} holds more than {MAX_VALUES:,} values: is it the right file?"
        )

    def refuse_constant(name: str) -> NoReturn:
        raise CameraFileError(f"{path}: {name} is not a finite number")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        data = dict(pairs)
        if len(data) < len(pairs):
            twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
            raise CameraFileError(f"{path}: the key {quoted(twice)} is there twice")
        return data

    try:
        return json.loads(text, parse_constant=refuse_constant, object_pairs_hook=unique)
    except CameraFileError:
        raise
    except json.JSONDecodeError as problem:
        raise CameraFileError(
            f"{path}, line {problem.lineno}: not valid JSON: {problem.msg}"
        ) from problem
    except (ValueError, RecursionError) as problem:  # a number of many digits; deep nesting
        raise CameraFileError(f"{path}: not the JSON of a camera") from problem
