"""What files held when they were read."""

import hashlib
from pathlib import Path

import pytest

from cubicfish_cli.app.fingerprint import fingerprint, sha256_of
from cubicfish_cli.core.errors import CubicfishError


def test_sha256_is_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"\r\n\0")
    assert sha256_of(path) == hashlib.sha256(b"\r\n\0").hexdigest()


def test_a_file_that_is_not_there_has_no_fingerprint(tmp_path: Path) -> None:
    with pytest.raises(CubicfishError, match=r"none\.csv does not exist"):
        fingerprint(tmp_path / "none.csv")
