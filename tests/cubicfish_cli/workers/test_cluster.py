"""A cluster's workers give what this machine gives, and whatever happens to them is said."""

import gc
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import cv2
import distant_work
import numpy as np
import pytest
from running import Run
from samples import SAMPLE

import cubicfish
from cubicfish import ClusterError, Listener, PhotoError
from cubicfish.workers import cluster
from cubicfish.workers.cluster import connect, do_one, versions_here
from cubicfish_cli.undistortion.batch import Job, write_many, write_one

# It is loaded where it is used: that takes its time in every process that collects tests.
pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="needs distributed")

ROOT = Path(__file__).parents[3]
PATIENCE_S = 30


class Processes:
    """A scheduler, and as many workers of one thread as a test wants."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._file = folder / "scheduler.json"
        self._workers: list[subprocess.Popen] = []
        self._scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show"
        )
        self.address = self._said()

    def _said(self) -> str:
        """The scheduler's address, once its file is there and written to its end."""
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                return json.loads(self._file.read_text())["address"]
            except (FileNotFoundError, json.JSONDecodeError):
                if time.monotonic() > end:
                    self.end(self._scheduler)
                    raise
                time.sleep(0.02)

    def _start(self, what: str, *args: str, path: Sequence[str] = ()) -> subprocess.Popen:
        return subprocess.Popen(
            [
                *(sys.executable, "-m", f"distributed.cli.dask_{what}", "--no-dashboard"),
                *("--scheduler-file", str(self._file), *args),
            ],
            cwd=self.folder,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join([*path, str(ROOT / "tests" / "support"), str(ROOT)]),
            },
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def worker(self, path: Sequence[str] = ()) -> subprocess.Popen:
        return self._start("worker", "--no-nanny", "--nthreads", "1", path=path)

    def have(self, count: int) -> str:
        """Start or end workers until there are so many; the scheduler's address."""
        self._workers = [worker for worker in self._workers if worker.poll() is None]
        while len(self._workers) > count:
            self.end(self._workers.pop())
        while len(self._workers) < count:
            self._workers.append(self.worker())
        self.wait_for(count)
        return self.address

    def wait_for(self, count: int) -> None:
        with connect_plainly(self.address) as client:
            end = time.monotonic() + PATIENCE_S
            while len(client.nthreads()) != count and time.monotonic() < end:
                time.sleep(0.02)
            assert len(client.nthreads()) == count

    @staticmethod
    def end(process: subprocess.Popen) -> None:
        process.kill()
        process.wait()

    def close(self) -> None:
        for process in (*self._workers, self._scheduler):
            self.end(process)


def connect_plainly(address: str):
    from distributed import Client

    return Client(address, set_as_default=False)


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    made = Processes(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


@pytest.fixture
def model(calibrated: Path) -> Path:
    return calibrated / "camera.yaml"


def jobs_of(folder: Path, count: int, out: str = "out") -> list[Job]:
    jobs = []
    for number in range(count):
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), np.full(distant_work.LENS.image_size[::-1], number, np.uint8))
        outputs = {"": folder / out / path.name}
        jobs.append(Job(name=path.name, photos={"": path}, outputs=outputs))
    return jobs


class Counting(Listener):
    """Calls a function with the counts of a step."""

    def __init__(self, call: Callable[[float, float], object]) -> None:
        self.call = call

    def progress(self, step: str, done: float = 0, total: float = 0, now: str = "") -> None:
        if total:
            self.call(done, total)


def undistort(jobs: Sequence[Job], address: str, render, wait_s=PATIENCE_S, **options) -> dict:
    with connect(address, wait_s=wait_s) as executor:
        how = replace(cubicfish.Run(), executor=executor, **options)
        return write_many(jobs, partial(write_one, render=render), how)


def contents(folder: Path) -> dict[str, bytes]:
    """Its pictures; what says whose they are stands beside them."""
    own = {path.name: path.read_bytes() for path in folder.iterdir()}
    own.pop(".undistorted.json", None)
    return own


@pytest.mark.slow
def test_pictures_are_the_same_to_the_byte(
    run: Run, processes: Processes, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where the workers are not
    (tmp_path / "photos").symlink_to(SAMPLE / "photos")
    (tmp_path / "camera.yaml").symlink_to(model)
    args = ["undistort", "photos", "-m", "camera.yaml", "--view", "equidistant"]
    here = run(*args, "here")
    there = run(*args, "there", "--scheduler", processes.have(2))
    assert contents(tmp_path / "there") == contents(tmp_path / "here")
    assert len(contents(tmp_path / "there")) == 10
    assert there.stdout == here.stdout.replace("here", "there")
    using = f"Using 2 workers with 2 threads at {processes.address}.\n"
    assert there.stderr == using + here.stderr
    again = run(*args, "there", "--scheduler", processes.address, code=1)
    assert "exists already" in again.stderr
    done = run(*args, "there", "--skip-existing", "--scheduler", processes.address)
    assert done.stdout == "nothing to do\n"


@pytest.mark.slow
def test_corners_are_the_same_to_the_byte(
    run: Run, processes: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    photos = tmp_path / "photos"
    photos.mkdir()
    for number in (1, 2, 3, 4):
        (photos / f"{number}.jpg").symlink_to(SAMPLE / "photos" / f"corner_0{number}.jpg")
    (photos / "5.jpg").write_bytes(b"\xff\xd8\xff")
    args = ["detect", "photos", "--target", SAMPLE / "target.yaml", "--no-cache", "--json"]
    here = run(*args, "-o", "here.csv", "-j", 1)
    there = run(*args, "-o", "there.csv", "--scheduler", processes.have(2))
    assert (tmp_path / "there.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()
    full = str(photos / "5.jpg")
    assert there.stdout.replace(full, "photos/5.jpg") == here.stdout.replace(
        "here.csv", "there.csv"
    )
    assert json.loads(there.stdout)["per_image"][0]["corners"] > 50


@pytest.mark.slow
def test_planes_find_their_poses_there(
    run: Run, processes: Processes, model: Path, tmp_path: Path
) -> None:
    (tmp_path / "new.jpg").symlink_to(SAMPLE / "photos" / "corner_01.jpg")
    args = ["undistort", tmp_path / "new.jpg", "-m", model, "--view", "plane:floor"]
    args += ["--target", SAMPLE / "target.yaml"]
    run(*args, tmp_path / "here.png")
    run(*args, tmp_path / "there.png", "--scheduler", processes.have(2))
    assert (tmp_path / "there.png").read_bytes() == (tmp_path / "here.png").read_bytes()


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing(processes: Processes, tmp_path: Path) -> None:
    jobs, seen = jobs_of(tmp_path, 12), []
    here = jobs_of(tmp_path, 12, "here")
    write_many(
        here, partial(write_one, render=distant_work.render), replace(cubicfish.Run(), jobs=1)
    )
    address = processes.have(2)
    failures = undistort(
        jobs,
        address,
        distant_work.render_and_end,
        listener=Counting(lambda *counts: seen.append(counts)),
    )
    assert failures == {}
    assert (tmp_path / "ended").exists()
    processes.wait_for(1)
    assert contents(tmp_path / "out") == contents(tmp_path / "here")
    assert seen == [(done, 12) for done in range(13)]


@pytest.mark.slow
def test_answers_hold_though_they_were_lost_since(
    processes: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a worker had is gone with it, also between its answer's coming and the look at it."""
    import distributed

    monkeypatch.setattr(distributed.Future, "status", property(lambda self: "lost"))
    assert undistort(jobs_of(tmp_path, 4), processes.have(1), distant_work.render) == {}
    assert len(contents(tmp_path / "out")) == 4


@pytest.mark.slow
def test_what_cannot_be_read_is_reported_and_where(processes: Processes, tmp_path: Path) -> None:
    jobs = jobs_of(tmp_path, 4)
    jobs[1].source.unlink()
    failures = undistort(jobs, processes.have(1), distant_work.render)
    assert list(failures) == ["1.png"]
    assert isinstance(failures["1.png"], PhotoError)
    host = os.uname().nodename
    assert f"1.png cannot be read on {host}: No such file" in str(failures["1.png"])
    assert sorted(contents(tmp_path / "out")) == ["0.png", "2.png", "3.png"]


@pytest.mark.slow
def test_when_the_last_worker_is_lost_it_ends(processes: Processes, tmp_path: Path) -> None:
    jobs = jobs_of(tmp_path, 9)
    address = processes.have(1)
    with pytest.raises(ClusterError) as caught:
        undistort(jobs, address, distant_work.render_and_always_end, wait_s=0.5)
    assert "has had no worker for 0.5 s (" in str(caught.value)
    assert " of 9 done): start some with 'dask worker tcp://" in str(caught.value)
    assert not [name for name in contents(tmp_path / "out") if name.startswith(".")]


def test_without_workers_it_waits_so_long_and_no_longer(
    processes: Processes, tmp_path: Path
) -> None:
    begun = time.monotonic()
    with pytest.raises(ClusterError) as caught:
        undistort(jobs_of(tmp_path, 1), processes.have(0), distant_work.render, wait_s=0.3)
    assert time.monotonic() < begun + 10
    said = str(caught.value)
    assert said.startswith(f"{processes.address} has had no worker for 0.3 s: ")
    assert "\n" not in said
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_worker_without_cubicfish_is_named(processes: Processes, tmp_path: Path) -> None:
    processes.have(0)
    (tmp_path / "cubicfish.py").write_text("raise ImportError('none here')\n")
    bare = processes.worker(path=[str(tmp_path)])
    try:
        with (
            pytest.raises(
                ClusterError, match=r"cannot load cubicfish .* install cubicfish [0-9.]+ there"
            ),
            connect(processes.address, wait_s=PATIENCE_S) as executor,
        ):
            list(executor.each(distant_work.process, [1]))
    finally:
        processes.end(bare)
        processes.wait_for(0)


@pytest.mark.slow
def test_workers_of_another_version_are_refused(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = processes.have(1)
    theirs = versions_here()["OpenCV"]
    monkeypatch.setattr(cluster, "versions_here", lambda: {**versions_here(), "OpenCV": "3.2"})
    with (
        pytest.raises(ClusterError, match=rf"has OpenCV {theirs} and this machine has 3\.2, whose"),
        connect(address, wait_s=PATIENCE_S) as executor,
    ):
        list(executor.each(distant_work.process, [1]))


def test_a_worker_that_comes_later_is_checked_too() -> None:
    assert do_one(distant_work.process, versions_here(), 1) == (os.getpid(),)
    with pytest.raises(ClusterError, match=r"a worker on \S+ has numpy .* this machine has 1\.0"):
        do_one(distant_work.process, {**versions_here(), "numpy": "1.0"}, 1)


@pytest.mark.slow
def test_an_interrupt_cancels_what_has_not_begun(
    processes: Processes, model: Path, tmp_path: Path
) -> None:
    photos, out = tmp_path / "in", tmp_path / "out"
    photos.mkdir()
    for number in range(200):
        (photos / f"{number}.jpg").symlink_to(SAMPLE / "photos" / "corner_01.jpg")
    args = ["undistort", str(photos), str(out), "-m", str(model), "-q"]
    with subprocess.Popen(
        [sys.executable, "-m", "cubicfish_cli", *args, "--scheduler", processes.have(1)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        end = time.monotonic() + PATIENCE_S
        while not list(out.glob("*.jpg")) and time.monotonic() < end:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert said == "Interrupted.\n"
    with connect_plainly(processes.address) as client:
        end = time.monotonic() + PATIENCE_S
        while any(client.processing().values()) and time.monotonic() < end:
            time.sleep(0.02)
    left = contents(out)
    assert 0 < len(left) < 200
    assert [name for name in left if name.startswith(".")] == []


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("tcp://127.0.0.1:9", "no scheduler answers at tcp://127.0.0.1:9 ("),
        ("nonsense", "no scheduler answers at nonsense (missing port"),
        ("", "no scheduler answers at '' (missing port"),
        ("tls://127.0.0.1:9", "no scheduler answers at tls://127.0.0.1:9 ("),
    ],
)
def test_a_scheduler_that_is_not_there_is_one_line(
    run: Run, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str, said: str
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    begun = time.monotonic()
    args = ["undistort", SAMPLE / "photos", tmp_path / "out", "-m", model]
    result = run(*args, "--scheduler", address, code=1)
    assert time.monotonic() < begun + 5
    assert result.stderr.startswith(f"Error: {said}")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
    del result
    gc.collect()  # dask hangs where a client that was never connected goes while one is made


@pytest.mark.slow
@pytest.mark.parametrize("said", [b"", np.random.default_rng(5).bytes(5000)])
def test_a_listener_that_is_no_scheduler_is_one_line_too(said: bytes) -> None:
    code = (
        "import sys\nfrom cubicfish.workers import cluster\n"
        "cluster._CONNECT_S = cluster._SLACK_S = 0.3\n"
        "with cluster.connect(sys.argv[1]):\n    pass"
    )
    with ExitStack() as open_, ThreadPoolExecutor() as threads:
        other = open_.enter_context(socket.create_server(("127.0.0.1", 0)))
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        threads.submit(lambda: open_.enter_context(other.accept()[0]).sendall(said))
        done = subprocess.run(
            [sys.executable, "-c", code, address], capture_output=True, text=True, timeout=20
        )
    assert "Exception ignored" not in done.stderr  # of what is left of a client
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"cubicfish.errors.ClusterError: no scheduler answers at {address}")


@pytest.mark.slow
def test_a_scheduler_that_is_lost_is_one_line(
    model: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    own = Processes(tmp_path_factory.mktemp("lost"))
    try:
        jobs, address = jobs_of(tmp_path, 60), own.have(1)

        def end_early(done: float, total: float) -> None:
            if done == 3:
                own.close()

        with pytest.raises(
            ClusterError, match=r"does not answer any more \(\d+ of 60 done\).*skip"
        ):
            undistort(jobs, address, distant_work.render_slowly, listener=Counting(end_early))
    finally:
        own.close()


def test_a_photo_that_ends_its_workers_is_that_photos_failure() -> None:
    from distributed import KilledWorker

    there = cluster.Cluster(None, "tcp://node:1", 1)
    problem = there._explain_failure(KilledWorker.__new__(KilledWorker), "")
    assert "ended from outside, as happens when memory runs out" in str(problem)
    with pytest.raises(ZeroDivisionError):
        there._explain_failure(ZeroDivisionError(), "")
