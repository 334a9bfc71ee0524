"""Comma-separated tables with a header: read into columns, with errors that name the line."""

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Self

import numpy as np
import numpy.typing as npt

from cubicfish.errors import CubicfishError
from cubicfish.files.reading import read_text
from cubicfish.wording import did_you_mean, is_name, quoted

MAX_BYTES = 100_000_000
MAX_VALUES = 16_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """The text of a table.

    Attributes:
        name: what the file is called in messages.
        error: the class of the errors that are raised about it.
        comment: the first line without its ``#`` where the file starts with one, else "".
        columns: the columns' values as text, by the header's names.
        lines: the line of the file that each row ends on.

    """

    name: str
    error: type[CubicfishError]
    comment: str
    columns: Mapping[str, Sequence[str]]
    lines: Sequence[int]

    def refuse(self, row: int, what: str) -> NoReturn:
        """Raise the table's error for a row (by its index)."""
        raise self.error(f"{self.name}, line {self.lines[row]}: {what}")

    def floats(self, column: str, default: float | None = None) -> npt.NDArray[np.float64]:
        """A column as (N,) finite numbers, or the default where there is no such column."""
        if default is not None and column not in self.columns:
            return np.full(len(self.lines), default)
        values = np.array(self._parse_numbers(column, float, "a finite number"))
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            text = self.columns[column][bad[0]]
            self.refuse(bad[0], f"{column} must be a finite number, not {quoted(text)}")
        return values

    def points(self, *columns: str) -> npt.NDArray[np.float64]:
        """Columns of finite numbers as (N, count)."""
        return np.stack([self.floats(column) for column in columns], axis=-1)

    def integers(self, column: str) -> npt.NDArray[np.intp]:
        """A column as (N,) whole numbers."""
        return np.array(self._parse_numbers(column, _parse_whole_number, "a whole number"), np.intp)

    def _parse_numbers(self, column: str, kind: Callable[[str], Any], must: str) -> list[Any]:
        numbers: list[Any] = []
        try:
            for text in self.columns[column]:
                numbers.append(kind(text))
        except ValueError:
            self.refuse(len(numbers), f"{column} must be {must}, not {quoted(text)}")
        return numbers

    def codes(self, column: str) -> tuple[tuple[str, ...], npt.NDArray[np.intp]]:
        """A column of names as the distinct names in order of appearance, and (N,) indices."""
        index: dict[str, int] = {}
        codes = [index.setdefault(name, len(index)) for name in self.columns[column]]
        for name, code in index.items():
            if not is_name(name):
                self.refuse(codes.index(code), f"{column} must be a name, not {quoted(name)}")
        # A name of the table's text would keep the memory in which its rows were read.
        names = tuple(name.encode().decode() for name in index)
        return names, np.array(codes, np.intp)

    @classmethod
    def read(
        cls,
        path: Path,
        *,
        required: Sequence[str],
        optional: Sequence[str],
        error: type[CubicfishError],
    ) -> Self:
        """Read a CSV file with a header, an optional first line that starts with ``#``.

        Columns may stand in any order. A byte order mark and any line ends are accepted.

        Raises:
            error: the file cannot be read, is not a CSV table, or lacks or has other columns.

        """
        text = read_text(path, max_bytes=MAX_BYTES, error=error)
        return cls.parse(str(path), text, required=required, optional=optional, error=error)

    @classmethod
    def parse(
        cls,
        name: str,
        text: str,
        *,
        required: Sequence[str],
        optional: Sequence[str],
        error: type[CubicfishError],
    ) -> Self:
        """As :meth:`read`, from text that is called ``name`` in messages."""
        if text.count(",") + text.count("\n") > MAX_VALUES:
            raise error(f"{name} holds more than {MAX_VALUES:,} values: is it the right file?")
        comment = ""
        if text.startswith("#"):
            comment, text = (*re.split("\r\n?|\n", text, maxsplit=1), "")[:2]
        offset = 1 if comment else 0
        rows, lines = _split_rows(name, text, offset, error)
        if not rows:
            raise error(
                f"{name} is empty: its header must be {','.join(required)}: make it again, or name "
                "another file"
            )
        header = [column.strip() for column in rows[0]]
        what = _explain_header(header, required, optional)
        if what:
            raise error(f"{name}, line {lines[0]}: {what}")
        if len(rows) == 1:
            raise error(
                f"{name} has a header and no rows below it: make it again, or name another file"
            )
        if set(map(len, rows)) != {len(header)}:
            index = next(i for i, row in enumerate(rows) if len(row) != len(header))
            raise error(
                f"{name}, line {lines[index]}: {len(rows[index])} values where {len(header)} belong"
            )
        del rows[0]
        columns = {column: [row[index] for row in rows] for index, column in enumerate(header)}
        return cls(
            name=name, error=error, comment=comment[1:].strip(), columns=columns, lines=lines[1:]
        )

    @staticmethod
    def text(rows: Iterable[Sequence[object]]) -> str:
        """Rows of values as CSV, quoted where needed; floats so that they read back exactly."""
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerows(rows)
        return text.getvalue()


def _explain_header(header: Sequence[str], required: Sequence[str], optional: Sequence[str]) -> str:
    """Say what is wrong with the names of a table's columns; nothing where they are right."""
    for mark, kind in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            return f"{kind} separate its values: save it as CSV with commas between them"
    for column in required:
        if column not in header:
            return f"the header must be {','.join(required)}: {quoted(column)} is missing"
    for index, column in enumerate(header):
        if column not in required and column not in optional:
            known = did_you_mean(column, [*required, *optional])
            return f"unknown column {quoted(column)}: {known}"
        if column in header[:index]:
            return f"the column {quoted(column)} is there twice"
    return ""


def _split_rows(
    name: str, text: str, offset: int, error: type[CubicfishError]
) -> tuple[list[list[str]], Sequence[int]]:
    """The rows that are not blank, and the line that each ends on."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    rows, lines = [], []
    try:
        for row in filter(None, reader):
            rows.append(row)
            lines.append(reader.line_num + offset)
    except csv.Error as problem:
        line = reader.line_num + offset
        raise error(f"{name}, line {line}: not a comma-separated table: {problem}") from problem
    return rows, lines


def _parse_whole_number(text: str) -> int:
    number = int(text)
    if abs(number) >= 2**62:
        raise ValueError("larger than any index")
    return number
