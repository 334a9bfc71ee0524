"""What is kept from one run to the next, and where."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import platformdirs
import pytest

from cubicfish_cli.app.terminal.progress import cache_folder, keep_fonts


def test_the_folder_is_the_named_one_else_the_users(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.setenv("CUBICFISH_CACHE", "mine")
    assert cache_folder() == tmp_path / "mine"
    monkeypatch.delenv("CUBICFISH_CACHE")
    assert cache_folder() == tmp_path / "caches" / "cubicfish"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder() == tmp_path / "home" / ".cache" / "cubicfish"


@pytest.mark.parametrize(
    ("system", "folder"),
    [("macos.MacOS", "home/Library/Caches/cubicfish"), ("unix.Unix", "home/.cache/cubicfish")],
)
def test_each_system_has_its_own_place(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, system: str, folder: str
) -> None:
    module, name = system.split(".")
    kind = getattr(importlib.import_module(f"platformdirs.{module}"), name)
    monkeypatch.setattr(platformdirs, "PlatformDirs", kind)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("CUBICFISH_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache_folder() == tmp_path / folder


def test_a_user_without_a_home_keeps_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.delenv("CUBICFISH_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache_folder() is None


def fonts_folder(*, keep: bool, **environment: str) -> Path:
    """Where a new process tells matplotlib to keep its list of fonts."""
    done = subprocess.run(
        [sys.executable, "-c",
         "import os; from cubicfish_cli.app.terminal.progress import keep_fonts\n"
         f"keep_fonts({keep})\n"
         "name = os.environ['MPLCONFIGDIR']; print(name, os.path.isdir(name))"],
        env={**os.environ, **environment}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    name, there = done.stdout.split()
    assert there == str(not keep)  # matplotlib makes it when it is loaded
    return Path(name)


def test_fonts_are_kept_with_the_rest_or_end_with_the_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("MPLCONFIGDIR", raising=False)
    assert fonts_folder(keep=True, CUBICFISH_CACHE=str(tmp_path)) == tmp_path / "matplotlib"
    gone = fonts_folder(keep=False, CUBICFISH_CACHE=str(tmp_path), TMPDIR=str(tmp_path))
    assert gone.parent == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_what_the_user_says_of_matplotlib_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLCONFIGDIR", "theirs")
    keep_fonts()
    assert os.environ["MPLCONFIGDIR"] == "theirs"
