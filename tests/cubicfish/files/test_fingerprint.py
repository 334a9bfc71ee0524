"""What files held when they were read."""

import hashlib
from pathlib import Path

import pytest

from cubicfish.errors import CubicfishError
from cubicfish.files.fingerprint import MAX_BYTES, Fingerprint


def test_sha256_is_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"\r\n\0")
    assert Fingerprint.of(path).sha256 == hashlib.sha256(b"\r\n\0").hexdigest()


def test_a_file_that_is_not_there_has_no_fingerprint(tmp_path: Path) -> None:
    with pytest.raises(CubicfishError, match=r"none\.csv does not exist"):
        Fingerprint.of(tmp_path / "none.csv")


def test_a_file_that_is_too_large_and_a_folder_have_none(tmp_path: Path) -> None:
    large = tmp_path / "large.bin"
    with large.open("wb") as file:
        file.truncate(MAX_BYTES + 1)  # a hole, which takes no room
    with pytest.raises(CubicfishError, match=r"large\.bin is larger than 2 GB"):
        Fingerprint.of(large)
    with pytest.raises(CubicfishError, match="is not a file"):
        Fingerprint.of(tmp_path)
