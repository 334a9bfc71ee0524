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

from cubicfish.arguments import refuse_misfit
from cubicfish.errors import CubicfishError
from cubicfish.listener import Listener

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
    listener: Listener = Listener()
    executor: Executor | None = None
    command: str | None = None

    def __post_init__(self) -> None:
        refuse_misfit("anew", self.anew, bool)
        if self.anew:
            object.__setattr__(self, "cache", None)

    def date(self) -> str:
        """The time in UTC, or that of SOURCE_DATE_EPOCH, with which results can be made again.

        Raises:
            CubicfishError: SOURCE_DATE_EPOCH is set to something else than seconds.

        """
        epoch = os.environ.get("SOURCE_DATE_EPOCH")
        try:
            moment = datetime.now(UTC) if epoch is None else datetime.fromtimestamp(int(epoch), UTC)
        except (ValueError, OverflowError, OSError) as error:
            raise CubicfishError(
                f"SOURCE_DATE_EPOCH={epoch!r} is not a time in seconds since 1970: "
                "correct or unset it"
            ) from error
        return moment.isoformat(timespec="seconds")

    def made_by(
        self,
        options: Mapping[str, Any],
        target: Fingerprint | None = None,
        files: Sequence[Fingerprint] = (),
    ) -> dict[str, Any]:
        """What a file says of how it was made, as plain data.

        Args:
            options: those that change what is made.
            target: the target's file.
            files: all other inputs.

        Returns:
            Version, date, command and options, and the SHA-256 of the target and of every input.

        Raises:
            CubicfishError: SOURCE_DATE_EPOCH is set to something else than seconds.

        """
        from cubicfish import __version__

        return {
            "version": __version__,
            "date": self.date(),
            **({} if self.command is None else {"command": _as_text(self.command)}),
            "options": dict(options),
            "target": _record_file(target) if target else None,
            "inputs": [_record_file(file) for file in files],
        }

    def work(self, step: str) -> Work:
        """Who looks at photos in a step, which begins now."""
        from cubicfish.workers.pool import Work

        progress = self.listener.counting(step)
        return Work(jobs=self.jobs, progress=progress, executor=self.executor)


def _record_file(file: Fingerprint) -> dict[str, str]:
    return {"file": _as_text(file.file), "sha256": file.sha256}


def _as_text(words: str) -> str:
    """What a name says, also where its bytes are no UTF-8, which no text file can hold."""
    return words.encode("utf-8", "backslashreplace").decode("utf-8")
