"""What tests share.

What fits is loaded where it is asked for: the process that hands tests out to others needs none.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from pathlib import Path

# Shells start background jobs with Ctrl-C ignored, and programs that tests start inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# As the command line does for itself, before anything loads numpy.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

# Where no compiled modules are kept, every process compiles tests and package again, which takes
# a sixth of the quick tests' time: pytest's own cache keeps them.
if sys.dont_write_bytecode:
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(Path(__file__).parents[1] / ".pytest_cache" / "compiled")
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Modules and tests stay as long as the process: to search them for garbage while they are
# collected, and beside each test, takes a quarter of that time and a fifteenth of the tests'.
gc.disable()

from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest
import yaml
from hypothesis import settings
from samples import SAMPLE

# What tests of the program share; those of the library run where it is not installed.
if find_spec("cubicfish_cli"):
    pytest_plugins = ["program"]

if TYPE_CHECKING:
    from cubicfish.fit.calibration import Calibration

# Tests read camera.yaml as often as commands do: by the quick loader where there is one.
yaml.SafeLoader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

# Busy machines are slow at times; no test judges by the clock. The inner loop tries fewer examples.
settings.register_profile("untimed", deadline=None)
settings.register_profile("quick", deadline=None, max_examples=25)
settings.load_profile("untimed")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("markexpr") == "not slow":
        settings.load_profile("quick")


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)  # tests leave little in rings: to search seldom is enough
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def nothing_from_outside(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No model and no cache of the user's.

    Other processes are started for photos only
    where a test asks for them: each loads OpenCV and SciPy first.
    """
    from cubicfish.workers import pool

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "_ITEMS_FOR_POOL", 1000)
        patch.delenv("CUBICFISH_MODEL", raising=False)
        patch.setenv("CUBICFISH_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))
        yield


@pytest.fixture
def in_time() -> Iterator[None]:
    """What waits for a file for ever is ended, and fails whatever comes of that."""
    hung = []

    def stop(*_: object) -> None:
        hung.append(True)
        raise AssertionError("it hangs")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
    assert not hung


@pytest.fixture(scope="session")
def fitted() -> Calibration:
    """The fit of the sample's exact corners."""
    from cubicfish import Target
    from cubicfish.fit import calibrate
    from cubicfish.io.corners_csv import load_corners

    target = Target.load(SAMPLE / "target.yaml")
    pairs = load_corners(SAMPLE / "true_corners.csv", target)
    return calibrate.calibrate(pairs, target=target, hold_out=False)
