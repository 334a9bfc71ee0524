"""The text of files that nobody vouches for, at a bounded cost."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.errors import CameraFileError


def read_bounded(path: Path, *, max_bytes: int) -> str:
    """The text of a camera's file of at most ``max_bytes``; a byte order mark is dropped.

    Raises:
        CameraFileError: the file cannot be read, is larger, or is not UTF-8 text.

    """
    try:
        return read_bounded_bytes(path, max_bytes=max_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        raise CameraFileError(f"{path} is not UTF-8 text: is it the right file?") from problem


def read_bounded_bytes(path: Path, *, max_bytes: int) -> bytes:
    """The contents of a camera's file of at most ``max_bytes``.

    Raises:
        CameraFileError: the file cannot be read, or is larger.

    """
    try:
        with Path(path).open("rb") as file:
            raw = file.read(max_bytes + 1)
    except OSError as problem:
        raise CameraFileError(f"{path} cannot be read: {problem.strerror or problem}") from problem
    if len(raw) > max_bytes:
        raise CameraFileError(
            f"{path} is larger than {max_bytes / 1e6:g} MB: is it the right file?"
        )
    return raw
