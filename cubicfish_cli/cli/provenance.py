"""What a file says about how it was made."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from cubicfish_cli import __version__
from cubicfish_cli.errors import CubicfishError

if TYPE_CHECKING:
    from cubicfish_cli.files import Fingerprint

_LONGEST_TITLE = 100
_CHANGES_NO_CAMERA = {
    "as_json", "compare", "jobs", "max_rms", "no_cache", "output", "overwrite", "report",
}  # fmt: skip


def check_title(title: str) -> None:
    """Refuse a camera's name that is no line of plain text.

    Raises:
        click.UsageError: it is not.

    """
    if not title.strip() or not title.isprintable() or len(title) > _LONGEST_TITLE:
        raise click.UsageError(
            f"--title must be a line of plain text, of at most {_LONGEST_TITLE} characters"
        )


def made_at() -> str:
    """The time in UTC, or that of SOURCE_DATE_EPOCH, with which results can be made again.

    Raises:
        CubicfishError: SOURCE_DATE_EPOCH is set to something else than seconds.

    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        moment = datetime.now(UTC) if epoch is None else datetime.fromtimestamp(int(epoch), UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise CubicfishError(
            f"SOURCE_DATE_EPOCH={epoch!r} is not a time in seconds since 1970: correct or unset it"
        ) from error
    return moment.isoformat(timespec="seconds")


def made_by_record(
    options: Mapping[str, Any], target: Fingerprint | None, files: Sequence[Fingerprint]
) -> dict[str, Any]:
    """Version, date, command and options, and the SHA-256 of the target and of every input.

    Raises:
        OutputError: a file is no longer what it was when it was read.

    """
    for file in (*files, *([target] if target else [])):
        file.refuse_changed()
    return {
        "version": __version__,
        "date": made_at(),
        "command": command_line(),
        "options": dict(options),
        "target": _of(target) if target else None,
        "inputs": [_of(file) for file in files],
    }


def command_line() -> str:
    """The command that is being run, without what is by default and what changes no camera."""
    context = click.get_current_context()
    words = context.command_path.split()
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(parameter, click.Argument):
            words += map(str, value if isinstance(value, tuple) else [value])
            continue
        given = context.get_parameter_source(parameter.name or "")
        if parameter.name not in context.params or parameter.name in _CHANGES_NO_CAMERA:
            continue
        if given is not ParameterSource.COMMANDLINE:
            continue
        names = parameter.secondary_opts if value is False else parameter.opts
        words.append(max(names or parameter.opts, key=len))
        if not isinstance(value, bool):
            words.append("x".join(map(str, value)) if isinstance(value, tuple) else str(value))
    return _text(shlex.join(words))


def _of(file: Fingerprint) -> dict[str, str]:
    return {"file": _text(str(file.path)), "sha256": file.sha256}


def _text(words: str) -> str:
    """What a name says, also where its bytes are no UTF-8, which no text file can hold."""
    return words.encode("utf-8", "backslashreplace").decode("utf-8")
