"""What files held when they were read: their hashes."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from cubicfish.errors import MISSING, CubicfishError

MAX_BYTES = 2_000_000_000
"""Of any one file that is read; most kinds have bounds far below."""


@dataclass(frozen=True, kw_only=True)
class FileRecord:
    """A file, as it was when it was read.

    Attributes:
        file: its name.
        sha256: of its bytes, 64 hexadecimal digits.

    """

    file: str = ""
    sha256: str = ""

    @property
    def path(self) -> Path:
        """The file."""
        return Path(self.file)


def fingerprint(path: Path) -> FileRecord:
    """Take a file's fingerprint, before it is read.

    Raises:
        CubicfishError: the file cannot be read.

    """
    try:
        if path.exists() and not path.is_file():  # a pipe can be read only once
            raise CubicfishError(f"{path} is not a file: give the name of one")
        if path.stat().st_size > MAX_BYTES:
            raise CubicfishError(f"{path} is larger than {MAX_BYTES / 1e9:g} GB: is it right?")
        return FileRecord(file=str(path), sha256=sha256_of(path))
    except FileNotFoundError as error:
        raise CubicfishError(f"{path} {MISSING}") from error
    except OSError as error:
        raise CubicfishError(
            f"{path} cannot be read ({error.strerror or error}): check its name and permissions"
        ) from error


def record_of_text(path: Path, text: str) -> FileRecord:
    """The record of a file that is going to hold a text."""
    return FileRecord(file=str(path), sha256=hashlib.sha256(text.encode()).hexdigest())


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file's bytes, as 64 hexadecimal digits.

    Raises:
        OSError: the file cannot be read.

    """
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
