"""Arrays in .npz files that nobody vouches for.

A small file can claim huge arrays: every size is read, and held against the others, before there
is room made for anything. Nothing in the file can run (no pickles).
"""

from __future__ import annotations

import math
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError

MAX_SMALL = 100_000
"""Bytes of an array whose shape is not known before."""
# Packed arrays may unpack to so much, whatever the file's own size, and so many times that size.
_ALWAYS, _TIMES = 200_000_000, 20
_MAX_DIRECTORY = 65_536
_MAX_HEADER = 1000
_BLOCK = 1 << 24


class Arrays:
    """The arrays of an open .npz file, by their names."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._archive.NameToInfo

    def kind(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """What an array claims to be: its shape and the type of its numbers.

        Raises:
            ViewError: it is not a plain array, or not as long as it claims.

        """
        with self._opened(name) as (_, shape, dtype):
            return shape, dtype

    def read(self, name: str, *, max_bytes: int = MAX_SMALL) -> npt.NDArray[Any]:
        """An array of at most ``max_bytes``.

        Raises:
            ViewError: as :meth:`kind`, or it is larger.

        """
        with self._opened(name) as (file, shape, dtype):
            length = math.prod(shape) * dtype.itemsize
            if length > max_bytes:
                raise ViewError(f"{name} is far too large")
            into = np.empty(length, np.uint8)
            for start in range(0, length, _BLOCK):
                block = file.read(min(_BLOCK, length - start))
                into[start : start + len(block)] = np.frombuffer(block, np.uint8)
        return into.view(dtype).reshape(shape) if length else np.empty(shape, dtype)

    @contextmanager
    def _opened(self, name: str) -> Iterator[tuple[IO[bytes], tuple[int, ...], np.dtype[Any]]]:
        member = self._archive.NameToInfo[f"{name}.npy"]
        with self._archive.open(member) as file:
            if np.lib.format.read_magic(file) != (1, 0):
                raise ValueError
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(
                file, max_header_size=_MAX_HEADER
            )
            length = math.prod(shape) * dtype.itemsize
            if dtype.hasobject or min(shape, default=0) < 0 or (fortran and len(shape) > 1):
                raise ValueError
            if member.file_size != file.tell() + length:
                raise EOFError
            yield file, shape, dtype


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
    """Open an .npz file.

    Raises:
        ViewError: it cannot be read, is none, is damaged, or unpacks to far more than its size;
            also while its arrays are read.

    """
    try:
        if path.exists() and not path.is_file():
            raise ViewError("is not a file", about=str(path))
        with path.open("rb") as file:
            size = _refuse_large_directory(file)
            with zipfile.ZipFile(file) as archive:
                _refuse_bombs(archive, size)
                yield Arrays(archive)
    except ViewError as problem:
        if problem.about:
            raise
        raise ViewError(str(problem), about=str(path), apart=True) from problem
    except OSError as problem:
        raise ViewError(f"{path} cannot be read: {problem.strerror or problem}") from problem
    except (  # what damage in one place or another of such a file was seen to raise
        zipfile.BadZipFile,
        zlib.error,
        struct.error,
        ValueError,
        EOFError,
        KeyError,
        NotImplementedError,
        RuntimeError,
        OverflowError,
        MemoryError,
    ) as problem:
        raise ViewError(f"{path} is not an undistortion map, or is damaged") from problem


def _refuse_large_directory(file: BinaryIO) -> int:
    """The file's size, where the list of what is in it is short: that is read as a whole.

    As numpy writes it, the record that says so is the file's end, without a comment.
    """
    size = file.seek(0, 2)
    file.seek(max(0, size - 98))
    end = file.read().rjust(98, b"\0")
    if end[76:80] != b"PK\5\6":
        raise zipfile.BadZipFile
    length = struct.unpack_from("<I", end, 88)[0]
    if end[56:60] == b"PK\6\7":  # sizes of 64 bits stand before
        if end[:4] != b"PK\6\6":
            raise zipfile.BadZipFile
        length = struct.unpack_from("<Q", end, 40)[0]
    if length > _MAX_DIRECTORY:
        raise ViewError("holds far more than six arrays")
    file.seek(0)
    return size


def _refuse_bombs(archive: zipfile.ZipFile, size: int) -> None:
    packed = 0
    for member in archive.infolist():
        if member.compress_type == zipfile.ZIP_DEFLATED:
            packed += member.file_size
        elif member.compress_type != zipfile.ZIP_STORED or member.file_size > size:
            raise zipfile.BadZipFile
    if packed > _ALWAYS + _TIMES * size:
        raise ViewError(f"unpacks to {packed / 1e6:,.0f} MB, far more than its size")
