"""Work for the processes of a cluster, which load this module by its name."""

import os
import signal
import time
from pathlib import Path

from synthetic import lens_of_size

from cubicfish import build_map, undistort
from cubicfish.files import whole_files as files
from cubicfish.views import CentralView

LENS = lens_of_size(0.125)
MAP = build_map(LENS, CentralView.with_field("perspective", 100, (40, 30)))


def render(job, photos) -> dict:
    return {"": undistort(photos[""], MAP)}


def render_slowly(job, photos) -> dict:
    time.sleep(0.05)
    return render(job, photos)


def render_and_end(job, photos) -> dict:
    """End the process the first time that this photo's picture stands, before anyone is told."""
    if job.source.name == "5.png":
        try:
            job.source.with_name("ended").touch(exist_ok=False)
        except FileExistsError:
            return render(job, photos)
        files.os.replace = _replace_and_end
    return render(job, photos)


def render_and_always_end(job, photos) -> dict:
    if int(job.source.stem) >= 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return render(job, photos)


def _replace_and_end(source: Path, path: Path) -> None:
    os.rename(source, path)
    if path.name == "5.png":
        os.kill(os.getpid(), signal.SIGKILL)


def process(number: int) -> int:
    time.sleep(0.02)
    return os.getpid()
