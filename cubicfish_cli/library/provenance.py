"""What a file says about how it was made."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from cubicfish_cli import __version__
from cubicfish_cli.errors import CubicfishError
from cubicfish_cli.files import Fingerprint


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
    command: str | None,
    options: Mapping[str, Any],
    target: Fingerprint | None,
    files: Sequence[Fingerprint],
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
        **({} if command is None else {"command": command}),
        "options": dict(options),
        "target": _of(target) if target else None,
        "inputs": [_of(file) for file in files],
    }


def _of(file: Fingerprint) -> dict[str, str]:
    return {"file": as_text(str(file.path)), "sha256": file.sha256}


def as_text(words: str) -> str:
    """What a name says, also where its bytes are no UTF-8, which no text file can hold."""
    return words.encode("utf-8", "backslashreplace").decode("utf-8")
