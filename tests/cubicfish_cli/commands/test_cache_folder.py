"""What is kept from one run to the next, and where."""

import importlib
import os
from pathlib import Path

import platformdirs
import pytest

from cubicfish_cli.terminal.progress import cache_folder


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
