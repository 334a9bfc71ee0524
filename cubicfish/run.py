"""How work is done, and what files say of how they were made.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from cubicfish.errors import (
    CubicfishError,
)
from cubicfish.listener import SILENT, Listener

if TYPE_CHECKING:
    from cubicfish.files.fingerprint import Fingerprint
    from cubicfish.workers.pool import Executor, Work


@dataclass(frozen=True, kw_only=True)
class Run:
    """How work is done; nothing here changes what is worked out.

    Attributes:
        jobs: photos to work on at a time; None for one per processor.
        cache: a folder in which what is found in photos and frames is kept; None for nowhere.
        anew: whether nothing that an earlier run found is used.
        overwrite: whether files that exist may be replaced.
        listener: who is told how far it is.
        executor: who looks at photos instead of processes here.
        command: the command line that is run, which files say of themselves.

    """

    checked_fields: ClassVar = True

    jobs: int | None = None
    cache: Path | None = None
    anew: bool = False
    overwrite: bool = False
    listener: Listener = SILENT
    executor: Executor | None = None
    command: str | None = None

    def __post_init__(self) -> None:
        if self.anew:
            object.__setattr__(self, "cache", None)

    def work(self, step: str) -> Work:
        """Who looks at photos in a step, which begins now."""
        from cubicfish.workers.pool import Work

        progress = self.listener.counting(step)
        return Work(jobs=self.jobs, progress=progress, executor=self.executor)


RUN: Run = Run()
"""With all processors, silently; nothing is kept or replaced."""


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
    from cubicfish import __version__

    return {
        "version": __version__,
        "date": made_at(),
        **({} if command is None else {"command": command}),
        "options": dict(options),
        "target": _record_file(target) if target else None,
        "inputs": [_record_file(file) for file in files],
    }


def _record_file(file: Fingerprint) -> dict[str, str]:
    return {"file": as_text(str(file.path)), "sha256": file.sha256}


def as_text(words: str) -> str:
    """What a name says, also where its bytes are no UTF-8, which no text file can hold."""
    return words.encode("utf-8", "backslashreplace").decode("utf-8")
