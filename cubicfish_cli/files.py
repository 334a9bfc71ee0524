"""Writing files so that they appear whole or not at all, and never over another unasked."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from cubicfish_cli.errors import CubicfishError, OutputError
from cubicfish_cli.machines import on_host


def refuse_existing(path: Path, *, overwrite: bool) -> None:
    """Raise :class:`OutputError` when ``path`` exists and may not be replaced."""
    if not overwrite and os.path.lexists(path):
        raise OutputError(f"{path} exists already: choose another name or add --overwrite")


@contextmanager
def whole_file(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary name beside ``path`` that becomes ``path`` when the block succeeds.

    The temporary file keeps the suffix of ``path``, since writers choose the format by it.
    Without ``overwrite`` the final step is a hard link, which fails if the name was taken
    in the meantime; with it, an atomic rename.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    with whole_files([path], overwrite=overwrite) as (temporary,):
        yield temporary


@contextmanager
def whole_files(paths: Sequence[Path], *, overwrite: bool) -> Iterator[tuple[Path, ...]]:
    """Yield one temporary name for each path; all become final when the block succeeds.

    Names that are taken are refused before the block starts. When the block fails, nothing
    is left of any file.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, or cannot be written.

    """
    paths = [Path(path) for path in paths]
    for path in paths:
        refuse_existing(path, overwrite=overwrite)
        if path.parent.exists() and not path.parent.is_dir():
            raise OutputError(f"{path} cannot be written: {path.parent} is a file, not a folder")
    token = secrets.token_hex(6)
    temporaries = tuple(
        path.with_name(f".{path.stem[:100]}.{token}.part{path.suffix}") for path in paths
    )
    path = paths[0]  # the one to name when something goes wrong
    try:
        for path in paths:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield temporaries
        for path, temporary in zip(paths, temporaries, strict=True):  # noqa: B007 - see except
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
        with ExitStack() as undo:
            for path, temporary in zip(paths, temporaries, strict=True):
                if overwrite:
                    os.replace(temporary, path)
                else:
                    _move_to_free_name(temporary, path)
                    undo.callback(path.unlink)
            undo.pop_all()
    except CubicfishError:  # says what went wrong already, and some are OSErrors too
        raise
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written{on_host()} ({error.strerror or error}): "
            "check the folder, its permissions and the free space"
        ) from error
    finally:
        for temporary in temporaries:
            with suppress(OSError):  # nothing was made where the folder itself is unusable
                temporary.unlink(missing_ok=True)


def _move_to_free_name(source: Path, path: Path) -> None:
    try:
        os.link(source, path)
    except FileExistsError:
        refuse_existing(path, overwrite=False)
        raise
    except OSError:  # a file system without hard links: check once more, then rename
        refuse_existing(path, overwrite=False)
        os.replace(source, path)


def write_text(path: Path, text: str, *, overwrite: bool) -> None:
    """Write ``text`` as UTF-8 to ``path``, whole or not at all."""
    with whole_file(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


@dataclass(frozen=True, kw_only=True)
class Fingerprint:
    """What a file held when it was looked at.

    Attributes:
        path: the file.
        sha256: of its bytes, 64 hexadecimal digits.
        stamp: its size, times and place on the disk, which change when it is written to.

    """

    path: Path
    sha256: str
    stamp: tuple[int, ...]

    def refuse_changed(self) -> None:
        """Raise :class:`OutputError` when the file is no longer what it was."""
        try:
            same = _stamp(self.path) == self.stamp
        except OSError:
            same = False
        if not same:
            raise OutputError(
                f"{self.path} changed while it was being read, and nothing was written: run again"
            )


def fingerprint(path: Path) -> Fingerprint:
    """Take a file's fingerprint, before it is read.

    Raises:
        CubicfishError: the file cannot be read.

    """
    try:
        stamp = _stamp(path)
        return Fingerprint(path=path, sha256=sha256_of(path), stamp=stamp)
    except OSError as error:
        raise CubicfishError(
            f"{path} cannot be read ({error.strerror or error}): check its name and permissions"
        ) from error


def _stamp(path: Path) -> tuple[int, ...]:
    status = path.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file's bytes, as 64 hexadecimal digits.

    Raises:
        OSError: the file cannot be read.

    """
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
