"""Files appear whole or not at all, and never over another unasked."""

import hashlib
import os
from pathlib import Path

import pytest

from cubicfish_cli import files
from cubicfish_cli.errors import CubicfishError, OutputError, PhotoError


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_written_file_is_all_that_is_left(tmp_path: Path) -> None:
    files.write_text(tmp_path / "new" / "a.txt", "é\n", overwrite=False)
    assert (tmp_path / "new" / "a.txt").read_bytes() == "é\n".encode()
    assert names(tmp_path / "new") == ["a.txt"]


def test_an_existing_file_is_kept_unless_overwriting(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(OutputError, match=r"a\.txt exists already: .*--overwrite"):
        files.write_text(path, "new", overwrite=False)
    assert path.read_text() == "old"
    files.write_text(path, "new", overwrite=True)
    assert path.read_text() == "new"
    assert names(tmp_path) == ["a.txt"]


def test_a_name_taken_during_the_work_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"

    def write() -> None:
        with files.whole_file(path, overwrite=False) as temporary:
            temporary.write_text("mine")
            path.write_text("theirs")

    with pytest.raises(OutputError, match="exists already"):
        write()
    assert path.read_text() == "theirs"
    assert names(tmp_path) == ["a.txt"]


def test_without_hard_links_the_name_is_checked_and_renamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_links(*_: object) -> None:
        raise PermissionError("no hard links here")

    monkeypatch.setattr(os, "link", no_links)
    path = tmp_path / "a.txt"
    files.write_text(path, "first", overwrite=False)
    assert path.read_text() == "first"
    with pytest.raises(OutputError), files.whole_file(path, overwrite=False):
        pass


def test_a_failing_block_leaves_nothing(tmp_path: Path) -> None:
    def fail() -> None:
        with files.whole_file(tmp_path / "a.txt", overwrite=False) as temporary:
            temporary.write_text("half")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail()
    assert names(tmp_path) == []


def test_an_error_that_says_what_is_wrong_passes_through(tmp_path: Path) -> None:
    with (
        pytest.raises(PhotoError, match="no such photo"),
        files.whole_file(tmp_path / "a.txt", overwrite=False),
    ):
        raise PhotoError("no such photo")


def test_an_unwritable_place_names_the_file_and_the_cause(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"a\.txt cannot be written: .*file is a file, not a"):
        files.write_text(tmp_path / "file" / "a.txt", "x", overwrite=False)
    with pytest.raises(OutputError, match=r"a\.txt cannot be written \(Not a directory\)"):
        files.write_text(tmp_path / "file" / "b" / "a.txt", "x", overwrite=False)
    with pytest.raises(OutputError, match=r"cannot be written \(File name too long\)"):
        files.write_text(tmp_path / ("n" * 300), "x", overwrite=False)


def test_the_temporary_name_keeps_the_suffix_and_fits_long_names(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 240 + ".png")
    with files.whole_file(path, overwrite=False) as temporary:
        assert temporary.suffix == ".png"
        assert temporary.parent == path.parent
        temporary.write_bytes(b"x")
    assert path.exists()


def test_several_files_appear_together_or_not_at_all(tmp_path: Path) -> None:
    paths = [tmp_path / "a.txt", tmp_path / "b.txt"]

    def write(fail: bool) -> None:
        with files.whole_files(paths, overwrite=False) as temporary:
            for path in temporary:
                path.write_text("x")
            assert not any(path.exists() for path in paths)
            if fail:
                raise RuntimeError("stop")

    with pytest.raises(RuntimeError):
        write(fail=True)
    assert names(tmp_path) == []
    write(fail=False)
    assert names(tmp_path) == ["a.txt", "b.txt"]


def test_several_files_stay_away_when_one_was_not_written(tmp_path: Path) -> None:
    paths = [tmp_path / "a.txt", tmp_path / "b.txt", tmp_path / "c.txt"]

    def write() -> None:
        with files.whole_files(paths, overwrite=False) as (first, _, last):
            first.write_text("x")
            last.write_text("x")

    with pytest.raises(OutputError, match=r"b\.txt cannot be written"):
        write()
    assert names(tmp_path) == []


def test_several_files_are_taken_back_when_a_later_name_was_taken(tmp_path: Path) -> None:
    paths = [tmp_path / "a.txt", tmp_path / "b.txt"]

    def write() -> None:
        with files.whole_files(paths, overwrite=False) as temporary:
            for path in temporary:
                path.write_text("mine")
            paths[1].write_text("theirs")

    with pytest.raises(OutputError, match=r"b\.txt exists already"):
        write()
    assert names(tmp_path) == ["b.txt"]
    assert paths[1].read_text() == "theirs"


def test_several_files_are_refused_before_the_work_when_one_name_is_taken(tmp_path: Path) -> None:
    (tmp_path / "b.txt").write_text("old")
    with (
        pytest.raises(OutputError, match=r"b\.txt exists"),
        files.whole_files([tmp_path / "a.txt", tmp_path / "b.txt"], overwrite=False),
    ):
        pytest.fail("the block must not start")
    assert names(tmp_path) == ["b.txt"]


def test_sha256_is_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"\r\n\0")
    assert files.sha256_of(path) == hashlib.sha256(b"\r\n\0").hexdigest()


@pytest.mark.parametrize("change", ["other", "longer than before", "", None])
def test_a_file_that_changes_while_it_is_read_is_told(tmp_path: Path, change: str | None) -> None:
    path = tmp_path / "corners.csv"
    path.write_text("1.25,")
    before = files.fingerprint(path)
    before.refuse_changed()
    assert before.sha256 == files.sha256_of(path)
    if change is None:
        path.unlink()
    else:
        path.write_text(change)
    with pytest.raises(OutputError, match=r"corners\.csv changed while it was being read"):
        before.refuse_changed()


def test_a_file_that_is_not_there_has_no_fingerprint(tmp_path: Path) -> None:
    with pytest.raises(CubicfishError, match=r"none\.csv cannot be read \(No such file"):
        files.fingerprint(tmp_path / "none.csv")
