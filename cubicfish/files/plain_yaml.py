"""Safe reading of plain YAML data from untrusted files.

Anchors, tags, duplicate keys, several documents, deep nesting and big files are refused,
so that what a person reads in the file is what the program gets, at a bounded cost.
Scalars follow YAML 1.2's core schema (``no`` is text, ``010`` is ten, ``1e-3`` is a number),
where PyYAML's default is YAML 1.1.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import yaml

from cubicfish.errors import CameraFileError, CubicfishError
from cubicfish.files.reading import read_text
from cubicfish.wording import did_you_mean, quoted

MAX_DEPTH = 12
MAX_VALUES = 500_000
_MAX_DIRECTIVES = 10  # the parser compares each with all before it

_SCALARS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+",
    "float": r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
}
_SCALAR = re.compile("|".join(f"(?P<{kind}>{pattern})" for kind, pattern in _SCALARS.items()))
# libyaml where PyYAML was built with it: 10 times faster
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_SafeDumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def load_plain_yaml(
    path: Path,
    *,
    error: type[CubicfishError],
    max_bytes: int = 1_000_000,
    if_empty: str = "is it the right file?",
) -> Any:
    """Read one YAML document of mappings, lists, text, numbers, booleans and nulls.

    Args:
        path: the file.
        error: the class to raise; its text is one line that names the file and the line.
        max_bytes: larger files are refused unread.
        if_empty: what to do about a file that holds nothing.

    Raises:
        error: the file cannot be read, is too large, or holds more than plain data.

    """
    text = read_text(path, max_bytes=max_bytes, error=error)
    return parse_plain_yaml(path, text, error=error, if_empty=if_empty)


def parse_plain_yaml(
    path: Path,
    text: str,
    *,
    error: type[CubicfishError],
    if_empty: str = "is it the right file?",
) -> Any:
    """Read the text of a file as :func:`load_plain_yaml` does; ``path`` is for messages."""
    if text.startswith("%") + text.count("\n%") + text.count("\r%") > _MAX_DIRECTIVES:
        raise error(f"{path}: directives (%) are not allowed: plain data only")
    try:
        documents = _read_documents(path, text, error)
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        what = problem.problem or problem.context or "malformed"
        raise error(f"{path}{line}: not valid YAML: {what}") from problem
    except yaml.YAMLError as problem:  # characters that YAML does not allow
        raise error(f"{path}: not valid YAML: it holds characters that are not text") from problem
    if not documents:
        raise error(f"{path} is empty: {if_empty}")
    return documents[0]


def _read_documents(path: Path, text: str, error: type[CubicfishError]) -> list[Any]:
    """Build the one document that a text holds, if any, from the parser's events."""
    tree = _Tree(path, error)
    for count, event in enumerate(yaml.parse(text, _Loader), start=1):
        if count > MAX_VALUES:
            raise error(f"{path} holds more than {MAX_VALUES:,} values: is it the right file?")
        tree.add(event)
    return tree.documents


class _Tree:
    """The documents of a file, while they are built."""

    def __init__(self, path: Path, error: type[CubicfishError]) -> None:
        self._path, self._error = path, error
        self.documents: list[Any] = []
        # The lists and mappings that are open, the innermost last.
        self._around: list[Any] = [self.documents]
        self._key: str | None = None  # of the innermost mapping, while its value is awaited

    def add(self, event: Any) -> None:
        """Add what one of the parser's events begins, holds or ends."""
        kind = type(event)

        def refuse(what: str) -> NoReturn:
            raise self._error(f"{self._path}, line {event.start_mark.line + 1}: {what}")

        if issubclass(kind, yaml.CollectionEndEvent):
            self._around.pop()
        elif kind is yaml.DocumentStartEvent and self.documents:
            refuse("a second document starts here: one is expected")
        elif issubclass(kind, yaml.NodeEvent):
            if event.anchor is not None:
                refuse("anchors and aliases (& and *) are not allowed: write values out")
            if event.tag is not None:
                refuse("tags (!) are not allowed: plain data only")
            if isinstance(self._around[-1], dict) and self._key is None:
                self._key = self._read_key(event, refuse)
            else:
                self._put(event, refuse)

    def _read_key(self, event: Any, refuse: Callable[[str], NoReturn]) -> str:
        if type(event) is not yaml.ScalarEvent:
            refuse("a key must be text")
        key: str = event.value
        if key in self._around[-1]:
            refuse(f"the key {quoted(key)} is there twice")
        return key

    def _put(self, event: Any, refuse: Callable[[str], NoReturn]) -> None:
        """Put a value into the innermost list or mapping; one that others follow in is open."""
        inner, kind = self._around[-1], type(event)
        value: Any = {} if kind is yaml.MappingStartEvent else []
        if kind is yaml.ScalarEvent:
            value = _read_scalar(event.value, refuse) if event.implicit[0] else event.value
        elif len(self._around) > MAX_DEPTH:
            refuse(f"nested more than {MAX_DEPTH} levels deep")
        if isinstance(inner, dict):
            inner[self._key], self._key = value, None
        else:
            inner.append(value)
        if kind is not yaml.ScalarEvent:
            self._around.append(value)


def _read_scalar(text: str, refuse: Callable[[str], NoReturn]) -> str | float | bool | None:
    """The value of text without quotes."""
    found = _SCALAR.fullmatch(text)
    kind = found.lastgroup if found else "text"
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind == "int":
        if len(text) > 300:  # beyond what a float holds; int() has a limit of its own
            refuse("a number with too many digits")
        return int(text)
    if kind == "float":
        return float(re.sub(r"\.(?=[iInN])", "", text))  # YAML writes .inf and .nan
    return text


class _Dumper(_SafeDumper):
    """Writes out parts that occur twice, since the reader refuses aliases."""

    def ignore_aliases(self, data: object) -> bool:
        return True


# Text that the reader would take for a number, such as a shot's name 08, is quoted.
for _kind, _pattern in _SCALARS.items():
    _Dumper.add_implicit_resolver(
        f"tag:yaml.org,2002:{_kind}", re.compile(rf"^(?:{_pattern})$"), [None]
    )


def plain_yaml_text(record: Any) -> str:
    """YAML of plain data: keys in their order, numbers in full, inner lists on one line."""
    return yaml.dump(
        record, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=2**31 - 1
    )


def mapping(path: Path | str, value: Any, what: str) -> dict[str, Any]:
    """Return a mapping, or raise an error that says what it should be."""
    if not isinstance(value, dict):
        raise CameraFileError(f"{path}: {what} must hold keys and values")
    return value


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
