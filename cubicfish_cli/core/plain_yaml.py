"""Safe reading of plain YAML data from untrusted files.

Anchors, tags, duplicate keys, several documents, deep nesting and big files are refused,
so that what a person reads in the file is what the program gets, at a bounded cost.
Scalars follow YAML 1.2's core schema (``no`` is text, ``010`` is ten, ``1e-3`` is a number),
where PyYAML's default is YAML 1.1.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

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
    try:
        _refuse_more_than_plain_data(path, text, error)
        node = yaml.compose(text, Loader=_PlainLoader)
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        what = problem.problem or problem.context or "malformed"
        raise error(f"{path}{line}: not valid YAML: {what}") from problem
    except yaml.YAMLError as problem:  # characters that YAML does not allow
        raise error(f"{path}: not valid YAML: it holds characters that are not text") from problem
    if node is None:
        raise error(f"{path} is empty: {if_empty}")
    return _plain(path, node, error)


def _refuse_more_than_plain_data(path: Path, text: str, error: type[CubicfishError]) -> None:
    if text.startswith("%") + text.count("\n%") + text.count("\r%") > _MAX_DIRECTIVES:
        raise error(f"{path}: directives (%) are not allowed: plain data only")
    depth = documents = 0
    events: Iterator[Any] = yaml.parse(text, Loader=_PlainLoader)
    for count, event in enumerate(events):
        if count > MAX_VALUES:
            raise error(f"{path} holds more than {MAX_VALUES:,} values: is it the right file?")
        where = f"{path}, line {event.start_mark.line + 1}"
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise error(f"{where}: anchors and aliases (& and *) are not allowed: write values out")
        if getattr(event, "tag", None) is not None:
            raise error(f"{where}: tags (!) are not allowed: plain data only")
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise error(f"{where}: a second document starts here: one is expected")
        elif isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                raise error(f"{where}: nested more than {MAX_DEPTH} levels deep")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _plain(path: Path, node: Any, error: type[CubicfishError]) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_plain(path, item, error) for item in node.value]
    if isinstance(node, yaml.MappingNode):
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            where = f"{path}, line {key_node.start_mark.line + 1}"
            if not isinstance(key_node, yaml.ScalarNode):
                raise error(f"{where}: a key must be text")
            if key_node.value in mapping:
                raise error(f"{where}: the key {quoted(key_node.value)} is there twice")
            mapping[key_node.value] = _plain(path, value_node, error)
        return mapping
    return _scalar(path, node, error)


def _scalar(path: Path, node: Any, error: type[CubicfishError]) -> Any:
    kind, text = node.tag.rsplit(":", 1)[-1], node.value
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind == "int":
        if len(text) > 300:  # beyond what a float holds; int() has a limit of its own
            raise error(f"{path}, line {node.start_mark.line + 1}: a number with too many digits")
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
