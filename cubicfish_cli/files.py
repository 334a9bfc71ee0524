"""Writing files so that they appear whole or not at all, and never over another unasked."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from cubicfish_cli.errors import CubicfishError, OutputError


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
            f"{path} cannot be written ({error.strerror or error}): "
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


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file's bytes, as 64 hexadecimal digits.

    Raises:
        OSError: the file cannot be read.

    """
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
