"""Safe reading of plain YAML data from untrusted files.

Anchors, tags, duplicate keys, several documents, deep nesting and big files are refused,
so that what a person reads in the file is what the program gets, at a bounded cost.
Scalars follow YAML 1.2's core schema (``no`` is text, ``010`` is ten, ``1e-3`` is a number),
where PyYAML's default is YAML 1.1.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import yaml

from cubicfish_cli.core.errors import CameraFileError, CubicfishError
from cubicfish_cli.core.reading import read_text
from cubicfish_cli.core.wording import did_you_mean, quoted

MAX_DEPTH = 12
MAX_VALUES = 500_000
_MAX_DIRECTIVES = 10  # the parser compares each with all before it

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _PlainLoader(_Base):  # libyaml's parser where PyYAML was built with it: 10 times faster
    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


_SCALARS = (
    ("null", r"^(?:~|null|Null|NULL|)$", ["~", "n", "N", ""]),
    ("bool", r"^(?:true|True|TRUE|false|False|FALSE)$", list("tTfF")),
    ("int", r"^[-+]?[0-9]+$", list("-+0123456789")),
    (
        "float",
        r"^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$",
        list("-+0123456789."),
    ),
)
for _tag, _pattern, _first in _SCALARS:
    _PlainLoader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(_pattern), _first)


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
    events = _Events(path, text, error)
    try:
        return events.document(if_empty)
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        what = problem.problem or problem.context or "malformed"
        raise error(f"{path}{line}: not valid YAML: {what}") from problem
    except yaml.YAMLError as problem:  # characters that YAML does not allow
        raise error(f"{path}: not valid YAML: it holds characters that are not text") from problem


class _Events:
    """What the parser finds in a text, thing by thing, made into plain data."""

    def __init__(self, path: Path, text: str, error: type[CubicfishError]) -> None:
        if text.startswith("%") + text.count("\n%") + text.count("\r%") > _MAX_DIRECTIVES:
            raise error(f"{path}: directives (%) are not allowed: plain data only")
        self.path, self.error, self.count = path, error, 0
        self.loader = _PlainLoader(text)

    def refuse(self, event: Any, what: str) -> NoReturn:
        raise self.error(f"{self.path}, line {event.start_mark.line + 1}: {what}")

    def following(self) -> Any:
        """The next event, if it is one of plain data."""
        event = self.loader.get_event()
        self.count += 1
        if self.count > MAX_VALUES:
            raise self.error(
                f"{self.path} holds more than {MAX_VALUES:,} values: is it the right file?"
            )
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            self.refuse(event, "anchors and aliases (& and *) are not allowed: write values out")
        if getattr(event, "tag", None) is not None:
            self.refuse(event, "tags (!) are not allowed: plain data only")
        return event

    def document(self, if_empty: str) -> Any:
        self.following()  # the stream starts
        if isinstance(self.following(), yaml.StreamEndEvent):
            raise self.error(f"{self.path} is empty: {if_empty}")
        value = self.value(self.following(), 0)
        self.following()  # the document ends
        event = self.following()
        if not isinstance(event, yaml.StreamEndEvent):
            self.refuse(event, "a second document starts here: one is expected")
        return value

    def value(self, event: Any, depth: int) -> Any:
        """What begins with an event, within so many lists and mappings."""
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(event)
        if depth == MAX_DEPTH:
            self.refuse(event, f"nested more than {MAX_DEPTH} levels deep")
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(event := self.following(), yaml.SequenceEndEvent):
                items.append(self.value(event, depth + 1))
            return items
        mapping: dict[str, Any] = {}
        while not isinstance(key := self.following(), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                self.refuse(key, "a key must be text")
            if key.value in mapping:
                self.refuse(key, f"the key {quoted(key.value)} is there twice")
            mapping[key.value] = self.value(self.following(), depth + 1)
        return mapping

    def scalar(self, event: Any) -> Any:
        tag = self.loader.resolve(yaml.ScalarNode, event.value, event.implicit)
        kind, text = tag.rsplit(":", 1)[-1], event.value
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() == "true"
        if kind == "int":
            if len(text) > 300:  # beyond what a float holds; int() has a limit of its own
                self.refuse(event, "a number with too many digits")
            return int(text)
        if kind == "float":
            return float(re.sub(r"\.(?=[iInN])", "", text))  # YAML writes .inf and .nan
        return text


_SafeDumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Dumper(_SafeDumper):
    """Writes out parts that are shared twice over, since the reader refuses aliases."""

    def ignore_aliases(self, data: object) -> bool:
        return True


# Text that the reader would take for a number, such as a shot's name 08, is quoted.
for _tag, _pattern, _first in _SCALARS:
    _Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(_pattern), _first)


def plain_yaml_text(record: Any) -> str:
    """YAML of plain data, keys in their order, numbers at full precision, inner lists on a line."""
    return yaml.dump(
        record, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=2**31 - 1
    )


def mapping(path: Path | str, value: Any, what: str) -> dict[str, Any]:
    """A record, or an error that says what it should be."""
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
