"""Closed and full standard streams, through the real entry point."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from samples import SAMPLE

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs a shell of POSIX")
PHOTO = SAMPLE / "photos" / "corner_01.jpg"
ALL_CLOSED = "<&- >&- 2>&-"
UNDISTORT = f"undistort {PHOTO} a.png --size 96x72 -v"
full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run ``cubicfish LINE`` in a shell, in a folder."""
    return subprocess.run(
        ["sh", "-c", f"{sys.executable} -m cubicfish_cli {line}"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.fixture(scope="module")
def unhindered(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The photo that is written where all streams are open."""
    folder = tmp_path_factory.mktemp("open")
    assert shell(f"{UNDISTORT} -m {calibrated}", folder).returncode == 0
    return (folder / "a.png").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    "closed", [">&-", "2>&-", ALL_CLOSED, pytest.param("2>/dev/full", marks=full)]
)
def test_streams_that_cannot_be_written_change_nothing_but_what_is_seen(
    calibrated: Path, unhindered: bytes, tmp_path: Path, closed: str
) -> None:
    done = shell(f"{UNDISTORT} -m {calibrated} {closed}", tmp_path)
    assert (done.returncode, done.stdout) == (0, "" if ">&-" in closed[:3] else done.stdout)
    assert (tmp_path / "a.png").read_bytes() == unhindered
    assert shell(f"undistort none.jpg c.png -m {calibrated} {closed}", tmp_path).returncode == 1
    assert shell(f"bogus {closed}", tmp_path).returncode == 2
    assert shell(f"--help {closed}", tmp_path).returncode == 0
    assert shell(f"undistort - flat/ -m {calibrated} <&- {closed}", tmp_path).returncode == 2


@pytest.mark.slow
@full
def test_results_that_cannot_be_printed_are_an_error_in_one_line(
    calibrated: Path, tmp_path: Path
) -> None:
    for line in (f"info {calibrated}", "--help", f"project 0,0,1 -m {calibrated}"):
        done = shell(f"{line} >/dev/full", tmp_path)
        assert done.returncode == 1
        what = "" if line == "--help" else "standard output: "
        assert done.stderr == f"Error: {what}No space left on device\n"


@pytest.mark.slow
def test_a_closed_stream_is_not_what_files_are_written_to(calibrated: Path, tmp_path: Path) -> None:
    """The first file that is opened would take the place of a closed standard output."""
    made = shell(f"map m.npz -m {calibrated} --size 64x48 {ALL_CLOSED}", tmp_path)
    assert made.returncode == 0
    assert (tmp_path / "m.npz").read_bytes()[:2] == b"PK"
    assert shell(f"info {calibrated} | head -n 1", tmp_path).stderr == ""
