"""Files of other tools that are fuzzed: lenses, read and looked through, and corners."""

import io
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from scipy.io import savemat

from cubicfish import Target
from cubicfish.target.boards.types import Checkerboard
from cubicfish_cli.extensions.formats.corner_files import read_corner_files
from cubicfish_cli.extensions.formats.mrcal_model import mrcal_text, read_mrcal
from cubicfish_cli.extensions.formats.mrcal_splined import SplinedLens
from cubicfish_cli.extensions.formats.ocamcalib import (
    ScaramuzzaLens,
    ocamcalib_text,
    read_ocamcalib,
)
from cubicfish_cli.foreign.file_contents import PlacedLens

SIZE = (640, 480)
RAYS = np.array(
    [[0, 0, 1], [0.1, 0.2, 1], [1, 0, 1e-3], [0, -1, -0.5], [0, 0, -1], [0, 0, 0]], float
)
_AXES = np.eye(3)
TARGET = Target(
    units="mm",
    boards=(
        Checkerboard(
            name="board",
            columns=3,
            rows=2,
            square=10.0,
            origin=np.zeros(3),
            x_axis=_AXES[0],
            y_axis=_AXES[1],
        ),
    ),
)


@cache
def _ocam() -> ScaramuzzaLens:
    lens = ScaramuzzaLens(
        image_size=SIZE,
        cx=320.0,
        cy=240.0,
        stretch=np.array([[1.001, 0.0002], [0.0001, 1.0]]),
        a=np.array([200.0, 0.0, -2e-3, 5e-6, -2e-8]),
    )
    return lens.with_inverse(1.5)


def ocamcalib_seeds() -> Sequence[bytes]:
    return [ocamcalib_text(PlacedLens(lens=_ocam())).encode()]


def mrcal_seeds() -> Sequence[bytes]:
    lens = SplinedLens(
        image_size=SIZE,
        fx=200.0,
        fy=201.0,
        cx=320.0,
        cy=240.0,
        order=3,
        fov_x_deg=150,
        control=np.full((4, 5, 2), 0.01),
        region=np.array([[0, 0], [639, 0], [639, 479], [0, 479], [0, 0]], float),
    )
    pinhole = (
        b"# x\n{'lensmodel': 'LENSMODEL_OPENCV5', 'intrinsics': [1e2, 1e2, 3, 4, 0, 0, .1, -.1, 0],"
        b"\n'extrinsics': [0,0,0,0,0,0,], 'imagersize': [640, 480],"
        b"\n'optimization_inputs': b'a{[(--'}"
    )
    return [mrcal_text(PlacedLens(lens=lens)).encode(), pinhole]


def look_through_ocamcalib(path: Path) -> object:
    lens = read_ocamcalib(path)
    return lens.project(RAYS), lens.project_by_inverse(RAYS)


def look_through_mrcal(path: Path) -> object:
    return read_mrcal(path).project(RAYS)


def vnlog_seeds() -> Sequence[bytes]:
    rows = [f"a.png {20.5 + 9 * (i % 3)} {30 + 9 * (i // 3)} 0" for i in range(6)]
    return ["\n".join(["# filename x y level", *rows, "b.png - - -"]).encode()]


def calib_data_seeds() -> Sequence[bytes]:
    column, row = np.arange(6) % 3, np.arange(6) // 3
    arrays = {
        "x_1": np.stack([20.5 + 9 * column, 30.0 + 9 * row]),
        "X_1": np.stack([10.0 * column, 10.0 - 10 * row, 0.0 * row]),
        "calib_name": "Image",
        "active_images": [[1]],
    }
    seeds = []
    for compressed in (False, True):
        file = io.BytesIO()
        savemat(file, arrays, do_compression=compressed)
        seeds.append(file.getvalue())
    return seeds


def photonvision_seeds() -> Sequence[bytes]:
    cells = [(i % 3, i // 3) for i in range(6)]
    one = {
        "locationInObjectSpace": [{"x": 0.01 * x, "y": 0.01 * y, "z": 0} for x, y in cells],
        "locationInImageSpace": [{"x": 20.5 + 9 * x, "y": 30 + 9 * y} for x, y in cells],
        "cornersUsed": [True] * 6,
        "snapshotName": "a.png",
    }
    size = {"width": 640.0, "height": 480.0}
    return [json.dumps({"resolution": size, "observations": [one]}).encode()]


def read_corners(path: Path) -> object:
    return read_corner_files([path], TARGET, image_size=SIZE).corners
