"""OpenCV's FileStorage as YAML, XML or JSON: plain data, whichever it is.

A matrix is a mapping with ``rows``, ``cols``, ``dt`` and ``data`` in all three; what marks it as
one (``!!opencv-matrix``, ``type_id``) is left out.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.fields import mapping, parse_plain_json, read_bounded
from cubicfish_cli.plain_yaml import MAX_DEPTH, parse_plain_yaml
from cubicfish_cli.wording import quoted

MAX_BYTES = 4_000_000
# What has more digits is no number of OpenCV's, and slow to read.
_LONGEST_NUMBER = 300
_INTEGER = re.compile(r"[-+]?[0-9]+", re.ASCII)
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
_ROOT = "opencv_storage"


def read_file_storage(path: Path) -> dict[str, Any]:
    """What a FileStorage file holds: mappings, lists, text, numbers.

    Raises:
        CameraFileError: the file cannot be read, is larger than 4 MB, is none of the three, holds
            a key twice or more than plain data (entities, anchors); one line.

    """
    text = read_bounded(path, max_bytes=MAX_BYTES)
    start = text.lstrip()[:1]
    if start == "<":
        return mapping(path, _parse_xml(path, text), "the file")
    if start == "{":
        return mapping(path, parse_plain_json(path, text), "the file")
    text = re.sub(r"\A%YAML[: ]1\.[0-9]\s*\n", "", text)
    text = re.sub(r"!!opencv-(?:nd-)?matrix\b", "", text)
    return mapping(path, parse_plain_yaml(path, text, error=CameraFileError), "the file")


class _Element:
    """An element that is being read."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.children: list[tuple[str, Any]] = []
        self.names: set[str] = set()
        self.text: list[str] = []


class _Xml:
    """Expat's handlers: a stack of open elements, and what the outermost one held."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.open: list[_Element] = []
        self.value: Any = None
        # The declaration's encoding is overruled: the text was decoded already.
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._refuse_doctype
        self.parser.EntityDeclHandler = self._refuse_doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._characters

    @property
    def where(self) -> str:
        return f"{self.path}, line {self.parser.CurrentLineNumber}"

    def _refuse_doctype(self, *_: object) -> NoReturn:
        raise CameraFileError(
            f"{self.where}: document types and entities (<!DOCTYPE, <!ENTITY) are not allowed: "
            "plain data only"
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self.open and name != _ROOT:
            raise CameraFileError(
                f"{self.where}: the outermost element is {quoted(name)}, not {_ROOT}: is it "
                "OpenCV's FileStorage?"
            )
        if len(self.open) >= MAX_DEPTH:
            raise CameraFileError(f"{self.where}: nested more than {MAX_DEPTH} levels deep")
        self.open.append(_Element(name))

    def _characters(self, text: str) -> None:
        self.open[-1].text.append(text)

    def _end(self, name: str) -> None:
        element = self.open.pop()
        text = "".join(element.text).strip()
        value: Any
        if not element.children:
            # A storage without anything is a mapping, and anything else without anything nothing.
            value = _values(text) if self.open or text else {}
        elif text:
            raise CameraFileError(f"{self.where}: {quoted(name)} holds text beside elements")
        elif all(child == "_" for child, _ in element.children):
            value = [one for _, one in element.children]
        elif any(child == "_" for child, _ in element.children):
            raise CameraFileError(f"{self.where}: {quoted(name)} holds a list beside names")
        else:
            value = dict(element.children)
        if not self.open:
            self.value = value
            return
        parent = self.open[-1]
        if name != "_" and name in parent.names:
            raise CameraFileError(
                f"{self.where}: {quoted(name)} is there twice in {quoted(parent.name)}"
            )
        parent.names.add(name)
        parent.children.append((name, value))


def _parse_xml(path: Path, text: str) -> Any:
    reader = _Xml(path)
    try:
        reader.parser.Parse(text.lstrip().encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as problem:
        what = expat.ErrorString(problem.code)
        raise CameraFileError(f"{path}, line {problem.lineno}: not valid XML: {what}") from problem
    return reader.value


def _values(text: str) -> Any:
    """A number, a list of numbers, or text."""
    words = text.split()
    if not words:
        return None
    if all(len(word) <= _LONGEST_NUMBER and _NUMBER.fullmatch(word) for word in words):
        numbers = [int(word) if _INTEGER.fullmatch(word) else float(word) for word in words]
        return numbers[0] if len(numbers) == 1 else numbers
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text
