"""Plain data of files <-> frozen records: one reader and one writer, by the fields' types.

The reader accepts data that may hold anything: a value of another type than its field's counts as
not known, which is NaN for a figure and the field's default for anything else. The writer writes
null for NaN. A finding is a mapping in a list, and its line by a name.
"""

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache, partial
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from cubicfish.judge.finding import Finding, of_line, of_record

R = TypeVar("R")
_Reader = Callable[[object], Any]


LEFT_OUT_IF_EMPTY: Mapping[str, Any] = {"left_out_if_empty": True}
"""Metadata of a field that is written only where there is something in it."""
KEY = "key"
"""Metadata of a field that files know by another name: that one."""


def key_of(one: Field[Any]) -> str:
    """The key of a record's field in files."""
    return str(one.metadata.get(KEY, one.name))


def recorded_number(value: object) -> float | None:
    """A finite number of a record; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None


def read_record(kind: type[R], value: object) -> R | None:
    """Read a record from plain data; None where they are no mapping, or lack a required field."""
    if not isinstance(value, Mapping):
        return None
    known = {}
    for name, key, read, required in _list_readers(cast("Hashable", kind)):
        found = read(value.get(key))
        if found is not None:
            known[name] = found
        elif required:
            return None
    return kind(**known)


def plain_record(value: Any) -> Any:
    """A record as plain data, keys in the order of its fields."""
    if isinstance(value, float):
        return None if math.isnan(value) else value
    if isinstance(value, Finding):
        return value.as_record()
    if isinstance(value, tuple):
        return [plain_record(one) for one in value]
    if isinstance(value, Mapping):
        return {
            name: str(one) if isinstance(one, Finding) else plain_record(one)
            for name, one in value.items()
        }
    if not is_dataclass(value):
        return value
    return {
        key_of(one): plain_record(own)
        for one in fields(value)
        if (own := getattr(value, one.name)) or one.metadata != LEFT_OUT_IF_EMPTY
    }


@cache
def _list_readers(kind: Any) -> list[tuple[str, str, _Reader, bool]]:
    """List the name, the key and the reader of each field, and whether the field is required."""
    types = get_type_hints(kind)
    return [
        (
            one.name,
            key_of(one),
            _make_reader(types[one.name]),
            one.default is one.default_factory is MISSING,
        )
        for one in fields(kind)
    ]


@cache
def _make_reader(kind: Any) -> _Reader:
    """Make the reader of values of a type; it returns None for other plain data."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):  # with None
        (kind,) = (one for one in inner if one is not NoneType)
        return _make_reader(kind)
    if origin is Literal:
        return lambda value: value if isinstance(value, str) and value in inner else None
    if origin is tuple:
        own = _read_figure if inner[0] is float else _make_reader(inner[0])
        return partial(_read_all, own, None if inner[-1] is ... else len(inner))
    if origin is Mapping:
        return partial(_read_mapping, _read_line if inner[1] is Finding else _make_reader(inner[1]))
    return _SIMPLE[kind] if kind in _SIMPLE else partial(read_record, kind)


def _read_all(read: _Reader, count: int | None, value: object) -> tuple[Any, ...] | None:
    if not isinstance(value, list) or count not in (None, len(value)):
        return None
    return tuple(known for known in map(read, value) if known is not None)


def _read_mapping(read: _Reader, value: object) -> dict[str, Any] | None:
    if not isinstance(value, Mapping):
        return None
    known = ((str(name), read(one)) for name, one in value.items())
    return {name: one for name, one in known if one is not None}


def _read_figure(value: object) -> float:
    number = recorded_number(value)
    return math.nan if number is None else number


def _read_count(value: object) -> int | None:
    number = recorded_number(value)
    return None if number is None else int(number)


def _read_text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _read_line(value: object) -> Finding | None:
    return of_line(value) if isinstance(value, str) else None


_SIMPLE: dict[Any, _Reader] = {
    float: recorded_number,
    int: _read_count,
    bool: lambda value: value if isinstance(value, bool) else None,
    str: _read_text,
    Any: lambda value: value,
    Finding: lambda value: of_record(value) if isinstance(value, Mapping) else None,
}
