"""What files held when they were read: their hashes."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from cubicfish.errors import CubicfishError

MAX_BYTES = 2_000_000_000
"""Of any one file that is read; most kinds have bounds far below."""


@dataclass(frozen=True, kw_only=True)
class Fingerprint:
    """What a file held when it was looked at.

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

    @classmethod
    def of(cls, path: Path) -> Self:
        """Take a file's fingerprint, before it is read.

        Raises:
            CubicfishError: the file cannot be read.

        """
        try:
            if path.exists() and not path.is_file():  # a pipe can be read only once
                raise CubicfishError(f"{path} is not a file: give the name of one")
            if path.stat().st_size > MAX_BYTES:
                raise CubicfishError(f"{path} is larger than {MAX_BYTES / 1e9:g} GB: is it right?")
            with path.open("rb") as file:
                sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        except FileNotFoundError as error:
            raise CubicfishError.missing(path) from error
        except OSError as error:
            raise CubicfishError(
                f"{path} cannot be read ({error.strerror or error}): check its name and permissions"
            ) from error
        return cls(file=str(path), sha256=sha256)

    @classmethod
    def of_text(cls, path: Path, text: str) -> Self:
        """Take the fingerprint of a file that is going to hold a text."""
        return cls(file=str(path), sha256=hashlib.sha256(text.encode()).hexdigest())
