"""Arguments of public calls, held to their annotations.

A name of a face is handed out as :func:`checked` makes it; inside, functions call each other as
they are. What annotations cannot say, such as bounds, is checked where it is used.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import os
import sys
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, wraps
from importlib import import_module
from numbers import Integral, Real
from typing import Any, ForwardRef, Literal, TypeVar, Union, get_args, get_origin

from cubicfish import wording
from cubicfish.errors import UsageError
from cubicfish.wording import did_you_mean, listed, quoted

_MOST_LISTED = 200  # of a long list, as many are looked at
_UNIONS = (Union, types.UnionType)
_WAYS = {
    "Camera": "load_camera(path).camera is one",
    "CameraFile": "load_camera reads one",
    "Calibrated": "calibrate makes one, load_camera reads one",
    "Calibration": "calibrate makes one",
    "CubicCamera": "load_camera(path).camera is one",
    "Detection": "detect makes one",
    "Observations": "detect finds them, load_corners reads them",
    "Rig": "calibrate_rig makes one, load_rig reads one",
    "Target": "Target.load reads one",
    "UndistortMap": "build_map makes one",
    "View": "build_view makes one",
}
"""How a caller gets a record, by the name of its class."""


def checked(function: Any, face: str) -> Any:
    """A function that refuses arguments that are not what its annotations say.

    Wrong counts of arguments and unknown names stay Python's own TypeError.

    Args:
        function: what a module defines, or another face offers.
        face: the package that offers it, where pickle looks for it.

    Raises:
        UsageError: an argument is something else; one line that names it, and what it must be.

    """
    if hasattr(function, "checked_arguments") or function.__module__ == wording.__name__:
        return function  # words are made of anything, such as what was refused
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError:  # Python says it best
            given = {}
        kinds = _hints(function)
        for name, value in given.items():
            if name in kinds:
                refuse_misfit(name, value, kinds[name])
        return function(*args, **kwargs)

    call.__module__, call.__qualname__ = face, function.__name__
    vars(call)["checked_arguments"] = True
    return call


def refuse_misfit(name: str, value: object, kind: Any) -> None:
    """Refuse a value that is not what an annotation says, or a record with such a field.

    Raises:
        UsageError: one line that names it, and what it must be.

    """
    for place, inner, must in _misfits(name, value, kind):
        ways = [_WAYS[word] for word in _names_in(must) if word in _WAYS]
        known = [*_literals_in(must)] if isinstance(inner, str) else []
        do = did_you_mean(inner, known) if known else ways[0] if ways else ""
        do = f": {do}" if do and not do.startswith("known") else ""
        raise UsageError(f"{place} must be {_describe(must)}, not {_name_value(inner)}{do}")


def _misfits(name: str, value: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """What does not fit: its place, the value, and the annotation that it does not fit."""
    if kind in (Any, object, inspect.Parameter.empty) or isinstance(kind, TypeVar | ForwardRef):
        return
    origin, inner = get_origin(kind) or kind, get_args(kind)
    if _is_array(kind) or _is_array(origin):
        if value is None or isinstance(value, str | bytes | Mapping | os.PathLike):
            yield name, value, kind
    elif origin in _UNIONS:
        yield from _misfits_of_all(name, value, kind)
    elif not _is_of(value, origin, inner):
        yield name, value, kind
    elif getattr(value, "checked_fields", False):
        record: Any = type(value)
        for field, must in _hints(record).items():
            if hasattr(value, field):
                yield from _misfits(f"{name}.{field}", getattr(value, field), must)
    elif inner and origin is not Literal:
        yield from _misfits_inside(name, value, kind)


def _misfits_of_all(name: str, value: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """What fits none of several annotations."""
    ways = [[*_misfits(name, value, one)] for one in get_args(kind)]
    if not all(ways):
        return
    # What is of the right sort, and has something wrong inside, says more.
    deeper = [found for found in ways if found[0][0] != name]
    if not deeper:
        yield name, value, kind
    elif len(deeper) == 1:
        yield from deeper[0]


def _misfits_inside(name: str, value: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """What a mapping or a list holds that does not fit."""
    origin, inner = get_origin(kind), get_args(kind)
    if isinstance(value, Mapping) and len(inner) == 2:
        for key, one in [*value.items()][:_MOST_LISTED]:
            yield from _misfits(f"a key of {name}", key, inner[0])
            yield from _misfits(f"{name}[{quoted(key)}]", one, inner[1])
    elif hasattr(value, "tolist"):
        yield from _misfits(name, value.tolist(), kind)
    elif isinstance(value, list | tuple):
        counted = origin is tuple and Ellipsis not in inner
        if counted and len(value) != len(inner):
            yield name, value, kind
            return
        each = inner if counted else inner[:1] * min(len(value), _MOST_LISTED)
        for index, (one, must) in enumerate(zip(value, each, strict=False)):
            yield from _misfits(f"{name}[{index}]", one, must)


def _is_of(value: Any, origin: Any, inner: Sequence[Any]) -> bool:
    """Whether a value is of a kind, whatever it holds."""
    if origin is Literal:
        return isinstance(value, str | int) and value in inner
    if origin in _NUMBERS:
        return _NUMBERS[origin](value)
    if isinstance(value, str | os.PathLike) and "\0" in str(value):
        return False  # no text or name of a file has that
    if not isinstance(origin, type):
        return True
    if getattr(origin, "_is_protocol", False):
        return all(hasattr(value, name) for name in _members(origin))
    if inner and _is_of_many(origin):
        return _is_series(value, origin)
    return isinstance(value, origin)


_NUMBERS: Mapping[Any, Callable[[Any], bool]] = {
    bool: lambda value: isinstance(value, bool) or type(value).__name__ in ("bool_", "bool"),
    int: lambda value: isinstance(value, Integral) and not isinstance(value, bool),
    # NaN is no number.
    float: lambda value: isinstance(value, Real) and type(value) is not bool and value == value,
}


def _is_of_many(kind: type) -> bool:
    """Whether an annotation is of a list or the like, with what is in it."""
    return issubclass(kind, Iterable) and not issubclass(kind, Mapping | str | bytes)


def _is_series(value: Any, origin: type) -> bool:
    """Whether a value is of many; text is none, and a list is as good as a tuple."""
    if isinstance(value, str | bytes) or (isinstance(value, Mapping) and origin is not Iterable):
        return False
    if origin is Sequence:
        return isinstance(value, Sequence) or getattr(value, "ndim", 0) > 0
    return isinstance(value, list | tuple if origin is tuple else origin)


def _is_array(kind: Any) -> bool:
    """Whether an annotation is of numpy's: what becomes an array is one."""
    numpy = sys.modules.get("numpy")
    typing = sys.modules.get("numpy.typing")
    return (numpy is not None and kind is numpy.ndarray) or (
        typing is not None and kind == typing.ArrayLike
    )


def _members(protocol: type) -> set[str]:
    """What an object must have to be used for a protocol."""
    bases = [base for base in protocol.__mro__ if getattr(base, "_is_protocol", False)]
    return {name for base in bases for name in vars(base) if not name.startswith("_")}


@cache
def _hints(holder: Any) -> dict[str, Any]:
    """The annotations of a function or a record, also those that only type checkers import."""
    kinds: dict[str, Any] = {}
    for one in reversed(holder.__mro__) if isinstance(holder, type) else (holder,):
        module = sys.modules[one.__module__]
        for name, written in inspect.get_annotations(one).items():
            kinds[name] = _resolve(written, module) if isinstance(written, str) else written
    return kinds


def _resolve(written: str, module: types.ModuleType) -> Any:
    for name in _words(written) - {*vars(module), *vars(builtins)}:
        if name not in _imported_for_checks(module):
            return Any
    names = {
        name: getattr(import_module(place), name)
        for name, place in _imported_for_checks(module).items()
        if name in _words(written)
    }
    return eval(written, {**vars(module), **names})


def _words(written: str) -> set[str]:
    return {
        one.id for one in ast.walk(ast.parse(written, mode="eval")) if isinstance(one, ast.Name)
    }


@cache
def _imported_for_checks(module: types.ModuleType) -> dict[str, str]:
    """Names that a module imports for type checkers alone, and from where."""
    try:
        tree = ast.parse(inspect.getsource(module))
    except OSError:  # there is no source: such annotations are not checked
        return {}
    return {
        alias.name: inner.module or ""
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in node.body
        if isinstance(inner, ast.ImportFrom)
        for alias in inner.names
    }


def _names_in(kind: Any) -> list[str]:
    """Names of the classes in an annotation."""
    inner = [name for one in get_args(kind) for name in _names_in(one)]
    return [kind.__name__, *inner] if isinstance(kind, type) else inner


_PLAIN = {
    bool: "True or False", int: "a whole number", float: "a number", str: "text",
    types.NoneType: "None", os.PathLike: "a path",
}  # fmt: skip


def _literals_in(kind: Any) -> list[str]:
    """Words that an annotation lists."""
    if get_origin(kind) is Literal:
        return [one for one in get_args(kind) if isinstance(one, str)]
    return [one for inner in get_args(kind) for one in _literals_in(inner)]


def _describe(kind: Any) -> str:
    """An annotation in words."""
    origin, inner = get_origin(kind) or kind, get_args(kind)
    if _is_array(origin) or _is_array(kind):
        return "an array"
    if origin in _UNIONS or origin is Literal:
        return _describe_choice(kind)
    if origin in _PLAIN:
        return _PLAIN[origin]
    if not isinstance(origin, type):
        return "something else"
    if issubclass(origin, os.PathLike):
        return "a path"
    if inner and issubclass(origin, Mapping):
        return f"a mapping to {_describe(inner[1])}"
    if inner and _is_of_many(origin):
        count = str(len(inner)) if origin is tuple and Ellipsis not in inner else "some"
        return f"a list of {count}, each {_describe(inner[0])}"
    return _with_article(origin.__name__)


def _describe_choice(kind: Any) -> str:
    """Several annotations in words: first the words that may be given."""
    words = [quoted(one) for one in _literals_in(kind)]
    if get_origin(kind) is not Literal:
        words += [_describe(one) for one in get_args(kind) if get_origin(one) is not Literal]
    return listed([*dict.fromkeys(words)], word="or")


def _name_value(value: object) -> str:
    """A value in an error: itself where it is plain, else what it is."""
    if value is None or isinstance(value, bool | Real):
        return str(value)
    if isinstance(value, str | os.PathLike):
        return quoted(str(value))
    if hasattr(value, "__array__"):
        return "an array"
    if isinstance(value, list | tuple | Mapping) and len(value) == 0:
        return f"an empty {type(value).__name__}"
    return _with_article(type(value).__name__)


def _with_article(name: str) -> str:
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"
