"""What files held when they were read."""

import hashlib
from pathlib import Path

import pytest

from cubicfish_cli.app.fingerprint import fingerprint, sha256_of
from cubicfish_cli.core.errors import CubicfishError, OutputError


def test_sha256_is_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"\r\n\0")
    assert sha256_of(path) == hashlib.sha256(b"\r\n\0").hexdigest()


@pytest.mark.parametrize("change", ["other", "longer than before", "", None])
def test_a_file_that_changes_while_it_is_read_is_told(tmp_path: Path, change: str | None) -> None:
    path = tmp_path / "corners.csv"
    path.write_text("1.25,")
    before = fingerprint(path)
    before.refuse_changed()
    assert before.sha256 == sha256_of(path)
    if change is None:
        path.unlink()
    else:
        path.write_text(change)
    with pytest.raises(OutputError, match=r"corners\.csv changed while it was being read"):
        before.refuse_changed()


def test_a_file_that_is_not_there_has_no_fingerprint(tmp_path: Path) -> None:
    with pytest.raises(CubicfishError, match=r"none\.csv does not exist"):
        fingerprint(tmp_path / "none.csv")
