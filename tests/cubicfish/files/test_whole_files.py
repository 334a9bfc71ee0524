"""Files appear whole or not at all, and never over another unasked."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cubicfish.errors import OutputError, PhotoError
from cubicfish.files import whole_files as files
from cubicfish.files.whole_files import write_files


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_written_file_is_all_that_is_left(tmp_path: Path) -> None:
    files.write_files({tmp_path / "new" / "a.txt": "é\n"}, overwrite=False)
    assert (tmp_path / "new" / "a.txt").read_bytes() == "é\n".encode()
    assert names(tmp_path / "new") == ["a.txt"]


def test_an_existing_file_is_kept_unless_overwriting(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(OutputError, match=r"a\.txt exists already: .*overwrite=True"):
        files.write_files({path: "new"}, overwrite=False)
    assert path.read_text() == "old"
    files.write_files({path: "new"}, overwrite=True)
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
    files.write_files({path: "first"}, overwrite=False)
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
        files.write_files({tmp_path / "file" / "a.txt": "x"}, overwrite=False)
    with pytest.raises(OutputError, match=r"a\.txt cannot be written: .*file is a file, not a"):
        files.write_files({tmp_path / "file" / "b" / "a.txt": "x"}, overwrite=False)
    with pytest.raises(OutputError, match=r"cannot be written \(File name too long\)"):
        files.write_files({tmp_path / ("n" * 300): "x"}, overwrite=False)


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


@pytest.mark.parametrize("name", ["../evil", "/tmp/evil", "a/../../evil", "a/../b", "../out/a"])
def test_files_that_lead_out_of_the_folder_are_not_written(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "out"
    with pytest.raises(OutputError, match="is outside of") as refused:
        write_files({folder / "a": "a", folder / name: "b"}, overwrite=True, folder=folder)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []
    mine = tmp_path / "mine"
    mine.write_text("mine")
    with pytest.raises(OutputError, match="is outside of"):
        write_files({folder / "a": "a"}, overwrite=True, obsolete=[mine], folder=folder)
    assert mine.read_text() == "mine"
    # The folder itself may be anywhere, as the user says.
    write_files(
        {tmp_path / "x" / ".." / "y" / "a": "a"}, overwrite=True, folder=tmp_path / "x/../y"
    )


OLD, NEW = {"a": "old a", "b": "old b", "gone": "old"}, {"a": "new a", "b": "new b", "c": "new c"}


def in_folder(folder: Path) -> dict[str, str]:
    """What is there under final names."""
    return {path.name: path.read_text() for path in folder.iterdir() if path.name[0] != "."}


def replace_old(folder: Path) -> None:
    """Replace ``a`` and ``b``, write ``c``, take ``gone`` away."""
    paths = [folder / name for name in NEW]
    obsolete = [folder / "gone"]
    with files.whole_files(paths, overwrite=True, obsolete=obsolete) as temporary:
        for place, text in zip(temporary, NEW.values(), strict=True):
            place.write_text(text)


def old_ones(folder: Path) -> Path:
    for name, text in OLD.items():
        (folder / name).write_text(text)
    return folder


def test_what_is_replaced_together_goes_together(tmp_path: Path) -> None:
    replace_old(old_ones(tmp_path))
    assert in_folder(tmp_path) == NEW
    assert names(tmp_path) == sorted(NEW)


def test_wherever_the_first_file_is_the_others_are_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, seen = os.replace, []

    def watched(source: Path, path: Path) -> None:
        replace(source, path)
        seen.append(in_folder(tmp_path))

    monkeypatch.setattr(os, "replace", watched)
    replace_old(old_ones(tmp_path))
    assert seen[-1] == {**NEW}
    assert len(seen) == 6
    assert [state for state in seen[:-1] if "a" in state] == []


def test_new_files_have_the_first_one_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link, seen = os.link, []

    def watched(source: Path, path: Path) -> None:
        link(source, path)
        seen.append(sorted(in_folder(tmp_path)))

    monkeypatch.setattr(os, "link", watched)
    paths = [tmp_path / name for name in "abc"]
    with files.whole_files(paths, overwrite=False) as temporary:
        for place in temporary:
            place.write_text("x")
    assert seen == [["c"], ["b", "c"], ["a", "b", "c"]]


@pytest.mark.parametrize("step", range(6))
@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("problem", [KeyboardInterrupt, PermissionError(1, "Not permitted")])
def test_what_was_to_be_replaced_is_put_back(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    step: int,
    when: str,
    problem: BaseException | type[BaseException],
) -> None:
    replace, done = os.replace, []

    def failing(source: Path, path: Path) -> None:
        done.append(path)
        fails = len(done) == step + 1
        if fails and when == "before":
            raise problem
        try:
            replace(source, path)
        finally:
            if fails:
                raise problem

    old_ones(tmp_path)
    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises((KeyboardInterrupt, OutputError)):
        replace_old(tmp_path)
    assert in_folder(tmp_path) == OLD
    assert names(tmp_path) == sorted(OLD)


@pytest.mark.parametrize("when", ["before", "after"])
def test_an_interrupt_while_names_are_given_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    link, done = os.link, []

    def failing(source: Path, path: Path) -> None:
        done.append(path)
        if len(done) == 2 and when == "before":
            raise KeyboardInterrupt
        link(source, path)
        if len(done) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "link", failing)

    def write() -> None:
        paths = [tmp_path / name for name in "abc"]
        with files.whole_files(paths, overwrite=False) as temporary:
            for place in temporary:
                place.write_text("x")

    with pytest.raises(KeyboardInterrupt):
        write()
    assert names(tmp_path) == []


def test_a_signal_while_temporary_files_are_removed_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unlink, done = Path.unlink, []

    def interrupted(path: Path, missing_ok: bool = False) -> None:
        done.append(path)
        if len(done) == 1:
            raise KeyboardInterrupt
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", interrupted)
    with pytest.raises(KeyboardInterrupt):
        files.write_files({tmp_path / "a.txt": "x"}, overwrite=False)
    assert names(tmp_path) == ["a.txt"]


def test_only_plain_files_are_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(OutputError, match=r"is no plain file, and is not replaced"):
            files.write_files({path: "x"}, overwrite=True)


def test_the_temporary_name_fits_long_names_of_other_scripts(tmp_path: Path) -> None:
    path = tmp_path / ("写" * 80 + ".png")
    with files.whole_file(path, overwrite=False) as temporary:
        temporary.write_bytes(b"x")
    assert names(tmp_path) == [path.name]


LEAVE = """
import os, signal, sys
from pathlib import Path
from cubicfish.files import whole_files as files
with files.whole_file(Path(sys.argv[1]), overwrite=False) as temporary:
    temporary.write_text("half")
    if sys.argv[2] == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    print("there", flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="what is alive is told on Linux only")
def test_what_a_killed_process_left_goes_with_the_next_and_nothing_else(tmp_path: Path) -> None:
    def start(fate: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", LEAVE, str(tmp_path / f"{fate}.txt"), fate],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    with start("dies") as dead:
        assert dead.wait() == -signal.SIGKILL
    (orphan,) = names(tmp_path)
    (tmp_path / orphan.replace("-", "0-", 1)).write_text("of another machine")
    (tmp_path / ".a.part.txt").write_text("of another program")
    others = set(names(tmp_path)) - {orphan}
    with start("lives") as alive:
        assert alive.stdout is not None
        assert alive.stdout.readline() == "there\n"
        (living,) = (name for name in names(tmp_path) if name.startswith(".lives."))
        files.write_files({tmp_path / "b.txt": "x"}, overwrite=False)
        assert set(names(tmp_path)) == {*others, living, "b.txt"}
        alive.communicate("")
    assert (tmp_path / "lives.txt").read_text() == "half"


def test_the_file_that_a_disk_has_no_room_for_is_named(tmp_path: Path) -> None:
    def fill(path: Path) -> None:
        raise OSError(28, "No space left on device")  # a write has no name to give

    given = {tmp_path / "a.txt": "a", tmp_path / "b.npz": fill, tmp_path / "c.txt": "c"}
    with pytest.raises(OutputError, match=r"b\.npz cannot be written \(No space left on device\)"):
        write_files(given, overwrite=False)
    assert names(tmp_path) == []
