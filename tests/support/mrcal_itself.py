"""What mrcal's own code makes of a file, where the system has it."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

PYTHON = Path("/usr/bin/python3")  # mrcal comes as a package of the system
# Asked for by its place: starting that Python takes half a second whenever tests are collected.
MRCAL = Path("/usr/lib/python3/dist-packages/mrcal/__init__.py")

needs_mrcal = pytest.mark.skipif(
    not (PYTHON.exists() and MRCAL.exists()), reason="mrcal is not installed"
)

PROJECT = """
import json, sys
import mrcal, numpy as np
model = mrcal.cameramodel(sys.argv[1])
rays = np.array(json.load(sys.stdin))
rays = mrcal.transform_point_rt(model.extrinsics_rt_fromref(), rays)
pixel = mrcal.project(rays, *model.intrinsics())
back = mrcal.unproject(pixel, *model.intrinsics(), normalize=True)
region = model.valid_intrinsics_region()
json.dump([pixel.tolist(), back.tolist(), region.tolist(), model.imagersize().tolist()], sys.stdout)
"""


def ask_mrcal(path: Path, points: np.ndarray) -> list[np.ndarray]:
    """Pixels of points of the reference frame, their rays, valid region and size."""
    done = subprocess.run(
        [PYTHON, "-c", PROJECT, path],
        input=json.dumps(points.tolist()),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "Invalid" not in done.stderr
    return [np.array(part) for part in json.loads(done.stdout)]
