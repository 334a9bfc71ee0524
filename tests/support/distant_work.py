"""Work for the processes of a cluster, which load this module by its name."""

import os
import signal
import time
from pathlib import Path

from synthetic import lens_of_size

from cubicfish_cli import files
from cubicfish_cli.undistortion.maps import build_map
from cubicfish_cli.undistortion.projections import PerspectiveView

LENS = lens_of_size(0.125)
MAP = build_map(LENS, PerspectiveView.with_field(100, (40, 30)))


def maps(source: Path, size: tuple[int, int]) -> list:
    return [MAP]


def slow_maps(source: Path, size: tuple[int, int]) -> list:
    time.sleep(0.05)
    return [MAP]


def maps_and_an_end(source: Path, size: tuple[int, int]) -> list:
    """End the process the first time that this photo's picture stands, before anyone is told."""
    if source.name == "5.png":
        try:
            source.with_name("ended").touch(exist_ok=False)
        except FileExistsError:
            return [MAP]
        files.os.replace = _replace_and_end
    return [MAP]


def maps_and_always_an_end(source: Path, size: tuple[int, int]) -> list:
    if int(source.stem) >= 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return [MAP]


def _replace_and_end(source: Path, path: Path) -> None:
    os.rename(source, path)
    if path.name == "5.png":
        os.kill(os.getpid(), signal.SIGKILL)


def process(number: int) -> int:
    time.sleep(0.02)
    return os.getpid()
