"""What the commands say: results to stdout, talk and progress to stderr."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import click

from cubicfish_cli.cli.options import verbosity

ProgressCallback = Callable[[int, int], None]


def result(text: str = "") -> None:
    """Print a line of the result to stdout."""
    click.echo(text)


def say(text: str) -> None:
    """Tell the user on stderr, unless ``--quiet``."""
    if verbosity() >= 0:
        click.echo(text, err=True)


def detail(text: str) -> None:
    """Tell the user on stderr, with ``--verbose`` only."""
    if verbosity() > 0:
        click.echo(text, err=True)


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON object; what is not finite becomes null, since JSON has no NaN."""
    click.echo(json.dumps(_jsonable(value), allow_nan=False, ensure_ascii=False))


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    return str(value)


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table to stdout: ruled on a terminal, aligned columns of plain text otherwise.

    Columns whose cells are all numbers (or empty, or a dash) are aligned to the right.
    """
    right = [all(_is_number(row[i]) for row in rows) for i in range(len(header))]
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        table = Table(header_style="bold", box=None, pad_edge=False)
        for name, is_right in zip(header, right, strict=True):
            table.add_column(name, justify="right" if is_right else "left")
        for row in rows:
            table.add_row(*(Text(cell) for cell in row))
        Console().print(table)
        return
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    for row in (header, *rows):
        cells = (
            cell.rjust(width) if is_right else cell.ljust(width)
            for cell, width, is_right in zip(row, widths, right, strict=True)
        )
        click.echo("  ".join(cells).rstrip())


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return cell in ("", "-")
    return True


@contextmanager
def progress(label: str) -> Iterator[ProgressCallback]:
    """Yield ``callback(done, total)`` that draws a bar on stderr, if that is a terminal."""
    if not sys.stderr.isatty() or verbosity() < 0:
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    # A descriptor of its own: decoders on other threads have theirs silenced meanwhile.
    with (
        os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding="utf-8") as stream,
        Progress(
            *columns, TimeRemainingColumn(), console=Console(file=stream), transient=True
        ) as bar,
    ):
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
