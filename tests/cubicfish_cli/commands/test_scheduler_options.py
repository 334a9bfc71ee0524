"""--scheduler where no cluster is needed to see what it does."""

import subprocess
import sys
from pathlib import Path

import pytest
from running import Run
from samples import SAMPLE

PHOTO = SAMPLE / "photos" / "corner_01.jpg"


@pytest.mark.slow
def test_nothing_of_dask_is_loaded_unless_it_is_asked_for(calibrated: Path, tmp_path: Path) -> None:
    code = (
        "import sys\nfrom cubicfish_cli.terminal.main import cli\n"
        f"cli(['undistort', {str(PHOTO)!r}, {str(tmp_path / 'o.png')!r}, '-m', "
        f"{str(calibrated / 'camera.yaml')!r}], standalone_mode=False)\n"
        f"cli(['detect', {str(PHOTO)!r}, '-t', {str(SAMPLE / 'target.yaml')!r}, '-o', "
        f"{str(tmp_path / 'c.csv')!r}], standalone_mode=False)\n"
        "print(sorted({'dask', 'distributed', 'tornado'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_without_dask_it_says_what_to_install(
    run: Run, calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setitem(sys.modules, "dask.config", None)
    args = ["undistort", PHOTO, tmp_path / "o.png", "-m", calibrated / "camera.yaml"]
    said = run(*args, "--scheduler", "tcp://node:8786", code=1).stderr
    assert "pip install 'cubicfish[scale]'" in said
    assert said.count("\n") == 1


def test_jobs_are_for_this_machine(run: Run, tmp_path: Path) -> None:
    options, said = ["--scheduler", "tcp://node:8786", "-j", "2"], "--jobs is for this machine"
    assert said in run("undistort", PHOTO, tmp_path / "o.png", *options, code=2).stderr
    args = ["detect", PHOTO, "-t", SAMPLE / "target.yaml", "-o", tmp_path / "c.csv"]
    assert said in run(*args, *options, code=2).stderr


def test_videos_are_not_for_a_scheduler(run: Run, calibrated: Path, tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"")
    args = ["undistort", tmp_path / "a.mp4", tmp_path / "b.mp4", "--scheduler", "tcp://node:8786"]
    said = run(*args, "-m", calibrated / "camera.yaml", code=2).stderr
    assert "--scheduler is for photos" in said
