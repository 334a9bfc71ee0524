"""The examples in docs/batch do what a plain run does, go on where they stopped, and say so."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from running import run_cli
from samples import SAMPLE

BATCH = Path(__file__).parents[2] / "docs" / "batch"
NAMES = ("a b", "it's 50% #1", "x [1]*", '-$y:"z"')


def is_gnu_parallel() -> bool:
    """Whether ``parallel`` is GNU's: moreutils has another program of that name."""
    if shutil.which("parallel") is None:
        return False
    done = subprocess.run(["parallel", "--version"], capture_output=True, text=True)
    return "GNU parallel" in done.stdout


needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
needs_parallel = pytest.mark.skipif(not is_gnu_parallel(), reason="needs GNU parallel")
needs_bash = pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")


class Cameras:
    """Folders of cameras whose calibration is ready, and a shell to run things among them."""

    def __init__(self, folder: Path, calibrated: Path, names: tuple[str, ...]) -> None:
        self.folder, self.names = folder, names
        self.log = folder.with_name("runs.txt")
        programs = folder.with_name("bin")
        programs.mkdir()
        cubicfish = programs / "cubicfish"
        cubicfish.write_text(
            "#!/bin/sh\n"
            f"echo \"$1\" >>'{self.log}'\n"
            f"exec '{sys.executable}' -m cubicfish_cli \"$@\"\n"
        )
        cubicfish.chmod(0o755)
        root = str(Path(__file__).parents[2])
        self.environ = {
            **os.environ,
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": root,
        }
        folder.mkdir()
        shutil.copy(SAMPLE / "target.yaml", folder)
        for name in names:
            camera = folder / name
            for below in ("board", "photos"):
                (camera / below).mkdir(parents=True)
            shutil.copy(SAMPLE / "photos" / "corner_01.jpg", camera / "board")
            for number, photo in enumerate(NAMES, start=2):
                source = SAMPLE / "photos" / f"corner_{number:02d}.jpg"
                shutil.copyfile(source, camera / "photos" / f"{photo}.jpg")
            before = time.time() - 100
            for path in (folder / "target.yaml", camera / "board", *camera.glob("*/*")):
                os.utime(path, (before, before))
            os.utime(camera / "photos", (before, before))
            shutil.copytree(calibrated, camera / "calibration")

    def plainly(self) -> dict[str, bytes]:
        """What undistort itself makes of each camera's photos, by path."""
        plain = self.folder.with_name("plain")
        for name in self.names:
            camera = self.folder / name
            run_cli(
                *("undistort", camera / "photos", plain / name / "flat", "--overwrite"),
                *("--model", camera / "calibration" / "camera.yaml", "--hfov", 90),
            )
        return pictures(plain)

    def run(self, *args: str, code: int = 0, **environ: str) -> subprocess.CompletedProcess[str]:
        self.log.write_text("")
        done = subprocess.run(
            args,
            cwd=self.folder,
            env={**self.environ, **environ},
            capture_output=True,
            text=True,
        )
        assert done.returncode == code, done.stdout + done.stderr
        return done

    def runs(self) -> list[str]:
        """The commands of cubicfish that the last run used."""
        return self.log.read_text().split()

    def spoil(self, photo: str) -> bytes:
        """Cut a photo short; its whole content."""
        path = self.folder / photo
        content = path.read_bytes()
        path.write_bytes(content[:3000])
        return content


def pictures(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.glob("*/flat/*.jpg")}


@pytest.fixture
def front(tmp_path: Path, calibrated: Path) -> Cameras:
    return Cameras(tmp_path / "work", calibrated, ("front",))


@pytest.fixture
def two(tmp_path: Path, calibrated: Path) -> Cameras:
    return Cameras(tmp_path / "work", calibrated, ("front", "left side"))


@pytest.mark.slow
@needs_make
def test_make_does_what_changed_and_no_more(front: Cameras) -> None:
    make, photos = ("make", "-f", str(BATCH / "Makefile")), front.folder / "front" / "photos"
    whole = front.spoil("front/photos/x [1]*.jpg")
    said = front.run(*make, code=2)
    assert "x [1]*.jpg is cut short" in said.stderr
    assert len(pictures(front.folder)) == len(NAMES) - 1
    (photos / "x [1]*.jpg").write_bytes(whole)
    assert "wrote front/flat/x [1]*.jpg: " in front.run(*make).stdout
    assert pictures(front.folder) == front.plainly()
    assert "Nothing to be done" in front.run(*make).stdout
    assert front.runs() == []
    tick()
    (photos / "a b.jpg").write_bytes(whole)
    (photos / "new one.jpg").write_bytes(whole)
    assert "wrote 2 pictures to front/flat" in front.run(*make).stdout
    assert front.runs() == ["undistort"]
    tick()
    os.utime(front.folder / "front" / "calibration" / "camera.yaml")
    assert f"wrote {len(NAMES) + 1} pictures" in front.run(*make).stdout
    assert pictures(front.folder) == front.plainly()


@pytest.mark.slow
@needs_make
def test_make_calibrates_when_a_photo_of_the_board_changed(front: Cameras) -> None:
    options = ("--no-hold-out", "--no-report")
    make = ("make", "-f", str(BATCH / "Makefile"), f"CALIBRATION={' '.join(options)}")
    board, result = front.folder / "front" / "board", front.folder / "front" / "calibration"
    for name in ("corner_02.jpg", "corner_03.jpg"):
        shutil.copy(SAMPLE / "photos" / name, board)
    front.run(*make)
    assert front.runs() == ["calibrate", "undistort"]
    plain = front.folder / "plain"
    run_cli("calibrate", board, "-t", front.folder / "target.yaml", "-o", plain, *options)
    assert (result / "corners.csv").read_bytes() == (plain / "corners.csv").read_bytes()
    # A fit's last bits depend on how a process's memory happens to be aligned.
    with np.load(result / "undistort_map.npz") as made, np.load(plain / "undistort_map.npz") as own:
        np.testing.assert_allclose(made["map_x"], own["map_x"], atol=0.01)
    assert "Nothing to be done" in front.run(*make).stdout
    tick()
    for path in board.iterdir():
        path.write_bytes(b"")
    said = front.run(*make, code=2)
    assert "corner_01.jpg" in said.stderr
    assert front.runs() == ["calibrate"]
    assert (result / "corners.csv").read_bytes() == (plain / "corners.csv").read_bytes()


@pytest.mark.slow
@needs_make
def test_make_goes_on_where_it_was_interrupted(front: Cameras) -> None:
    make = ("make", "-f", str(BATCH / "Makefile"))
    photos, flat = front.folder / "front" / "photos", front.folder / "front" / "flat"
    for number in range(200):
        (photos / f"{number}.jpg").symlink_to(SAMPLE / "photos" / "corner_01.jpg")
    with subprocess.Popen(
        make, cwd=front.folder, env=front.environ, start_new_session=True, stderr=subprocess.PIPE
    ) as process:
        end = time.monotonic() + 30
        while len(list(flat.glob("*.jpg"))) < 3 and time.monotonic() < end:
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        process.communicate(timeout=30)
    assert process.returncode != 0
    done = {path: path.stat().st_mtime_ns for path in flat.glob("*.jpg")}
    assert 3 <= len(done) < len(NAMES) + 200
    assert f"skipped {len(done)} photos" in front.run(*make).stderr
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert pictures(front.folder) == front.plainly()


@pytest.mark.slow
@needs_parallel
def test_parallel_does_the_rest_after_failures(two: Cameras) -> None:
    parallel = ("bash", str(BATCH / "parallel.sh"), "target.yaml", *two.names)
    expected = two.plainly()
    whole = two.spoil("left side/photos/x [1]*.jpg")
    (two.folder / "front" / "calibration").rename(two.folder / "kept")
    board = two.folder / "front" / "board" / "corner_01.jpg"
    board.write_bytes(b"")
    said = two.run(*parallel, code=1)
    assert "left side/photos/x [1]*.jpg is cut short" in said.stderr
    assert "front/board/corner_01.jpg is empty" in said.stderr
    assert {path.split(os.sep)[0] for path in pictures(two.folder)} == {"left side"}
    assert len(pictures(two.folder)) == len(NAMES) - 1
    jobs = [line.split("\t") for line in (two.folder / "jobs.log").read_text().splitlines()[1:]]
    assert ["1", "calibrate front"] in [[job[6], job[8]] for job in jobs]
    (two.folder / "left side" / "photos" / "x [1]*.jpg").write_bytes(whole)
    (two.folder / "kept").rename(two.folder / "front" / "calibration")
    two.run(*parallel)
    assert pictures(two.folder) == expected


@pytest.mark.slow
@needs_bash
def test_the_tasks_of_an_array_do_all_photos_once(two: Cameras) -> None:
    expected, seen = two.plainly(), 0
    for index in range(3):
        two.run(*array(two), **task(1 + index, 3, first=1))
        done = len(pictures(two.folder))
        assert done - seen in (2, 4)  # of four photos each camera
        seen = done
    assert pictures(two.folder) == expected
    said = two.run(*array(two), **task(0, 1))
    assert said.stdout == "nothing to do\n" * 2


@pytest.mark.slow
@needs_bash
def test_a_task_that_fails_says_so_and_can_be_run_again(two: Cameras) -> None:
    expected = two.plainly()
    whole = two.spoil("front/photos/a b.jpg")
    said = two.run(*array(two), **task(0, 1), code=1)
    assert "a b.jpg is cut short" in said.stderr
    assert len(pictures(two.folder)) == len(expected) - 1
    (two.folder / "front" / "photos" / "a b.jpg").write_bytes(whole)
    assert "wrote front/flat/a b.jpg: " in two.run(*array(two), **task(0, 1)).stdout
    assert pictures(two.folder) == expected


@needs_bash
def test_arrays_larger_than_the_work_or_with_gaps(two: Cameras) -> None:
    two.run(*array(two), **task(99, 100))
    assert two.runs() == []
    assert "submit it whole" in two.run(*array(two), **task(7, 2), code=2).stderr


@pytest.mark.slow
@needs_bash
def test_an_array_calibrates_one_camera_a_task(two: Cameras) -> None:
    script = ("bash", str(BATCH / "calibrate.slurm"), "target.yaml", *two.names)
    shutil.rmtree(two.folder / "left side" / "calibration")
    (two.folder / "left side" / "board" / "corner_01.jpg").write_bytes(b"")
    two.run(*script, **task(0, 3))
    two.run(*script, **task(2, 3))
    assert two.runs() == []
    said = two.run(*script, **task(1, 3), code=1)
    assert "left side/board/corner_01.jpg is empty" in said.stderr


def tick() -> None:
    """Let the clock by which files are dated go on."""
    time.sleep(0.02)


def array(cameras: Cameras) -> tuple[str, ...]:
    return ("bash", str(BATCH / "undistort.slurm"), *cameras.names)


def task(number: int, count: int, first: int = 0) -> dict[str, str]:
    """What Slurm sets in a task of an array."""
    return {
        "SLURM_ARRAY_TASK_ID": str(number),
        "SLURM_ARRAY_TASK_COUNT": str(count),
        "SLURM_ARRAY_TASK_MIN": str(first),
        "SLURM_CPUS_PER_TASK": "1",
    }
