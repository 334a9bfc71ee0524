"""Many photos: each done once, a few at a time, whatever becomes of the others."""

import threading
import time
from functools import partial

import cv2
import numpy as np
import pytest
from synthetic import lens_of_size

from cubicfish import Listener, PhotoError, Run, ViewError, build_map, undistort
from cubicfish.views import CentralView
from cubicfish_cli.undistortion.batch import Job, write_many, write_one

LENS = lens_of_size(0.125)
MAP = build_map(LENS, CentralView.with_field("perspective", 100, (40, 30)))


def jobs_of(folder, count):
    jobs = []
    for number in range(count):
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), np.full(LENS.image_size[::-1], number, np.uint8))
        out = folder / "out" / path.name
        jobs.append(Job(name=path.name, photos={"": path}, outputs={"": out}))
    return jobs


def render(job, photos):
    return {part: undistort(photos[""], MAP) for part in job.outputs}


class Counting(Listener):
    def __init__(self):
        self.seen = []

    def progress(self, step, done=0, total=0, now=""):
        if total:
            self.seen.append((done, total))


def run(jobs, render=render, workers=2, listener=Listener()):
    how = Run(jobs=workers, listener=listener)
    return write_many(jobs, partial(write_one, render=render), how)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_every_photo_is_done_and_counted(tmp_path, workers):
    jobs, listener = jobs_of(tmp_path, 12), Counting()
    assert run(jobs, workers=workers, listener=listener) == {}
    assert listener.seen == [(done, 12) for done in range(13)]
    for number, job in enumerate(jobs):
        assert cv2.imread(str(job.outputs[""]), cv2.IMREAD_UNCHANGED).max() == number


@pytest.mark.parametrize("workers", [1, 3])
def test_failures_come_back_in_order_and_the_rest_is_done(tmp_path, workers):
    jobs = jobs_of(tmp_path, 8)
    jobs[6].source.write_bytes(b"")
    jobs[2].source.unlink()

    def refuse_one(job, photos):
        if job.name == "4.png":
            raise ViewError("no such view")
        return render(job, photos)

    failures = run(jobs, refuse_one, workers)
    assert list(failures) == ["2.png", "4.png", "6.png"]
    assert list(map(type, failures.values())) == [PhotoError, ViewError, PhotoError]
    assert "4.png: no such view" in str(failures["4.png"])
    assert len(list((tmp_path / "out").iterdir())) == 5


def test_no_more_photos_are_in_work_than_asked_for(tmp_path):
    lock, working, most = threading.Lock(), 0, 0

    def count(job, photos):
        nonlocal working, most
        with lock:
            working += 1
            most = max(most, working)
        time.sleep(0.01)
        with lock:
            working -= 1
        return render(job, photos)

    run(jobs_of(tmp_path, 12), count, workers=3)
    assert 1 < most <= 3


def test_an_unknown_error_stops_the_batch(tmp_path):
    def fail(job, photos):
        raise ZeroDivisionError

    threads = cv2.getNumThreads()
    with pytest.raises(ZeroDivisionError):
        run(jobs_of(tmp_path, 50), fail)
    assert cv2.getNumThreads() == threads


def test_several_outputs_of_a_photo_appear_together(tmp_path):
    (job,) = jobs_of(tmp_path, 1)
    pair = {"a": tmp_path / "out" / "a.png", "b": tmp_path / "out" / "b.gif"}
    failures = run([Job(name="x", photos=job.photos, outputs=pair)])
    assert "b.gif" in str(failures["x"])
    assert not (tmp_path / "out").exists()


def test_a_shot_is_of_several_photos_and_its_picture_of_all(tmp_path):
    one, other = jobs_of(tmp_path, 2)
    photos = {"left": one.source, "right": other.source}
    shot = Job(name="1", photos=photos, outputs={"": tmp_path / "out.png"})

    def add(job, pictures):
        return {"": pictures["left"] + 10 * pictures["right"]}

    assert run([shot], add) == {}
    assert cv2.imread(str(tmp_path / "out.png"), cv2.IMREAD_UNCHANGED).max() == 10
    other.source.write_bytes(b"")
    broken = Job(name="2", photos=photos, outputs={"": tmp_path / "b.png"})
    assert "1.png is empty" in str(run([broken], add)["2"])
