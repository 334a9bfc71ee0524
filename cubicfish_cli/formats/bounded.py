"""The text of files that nobody vouches for, at a bounded cost."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.reading import read_bytes, read_text


def read_bounded(path: Path, *, max_bytes: int) -> str:
    """The text of a camera's file of at most ``max_bytes``; a byte order mark is dropped.

    Raises:
        CameraFileError: the file cannot be read, is larger, or is not UTF-8 text.

    """
    return read_text(path, max_bytes=max_bytes, error=CameraFileError)


def read_bounded_bytes(path: Path, *, max_bytes: int) -> bytes:
    """The contents of a camera's file of at most ``max_bytes``.

    Raises:
        CameraFileError: the file cannot be read, or is larger.

    """
    return read_bytes(path, max_bytes=max_bytes, error=CameraFileError)
