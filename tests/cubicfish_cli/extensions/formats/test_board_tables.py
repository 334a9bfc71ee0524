"""Corners of Bouguet's toolbox and of PhotonVision: read by the names that truth has."""

import io
import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat
from synthetic import TRUE_LENS, flat_board, poses_around, synthetic_corners

from cubicfish import CorrespondenceError, CubicfishError, Observations, UsageError
from cubicfish_cli.extensions.formats import board_tables
from cubicfish_cli.extensions.formats.corner_files import read_corner_files
from tests.cubicfish_cli.extensions.formats.test_vnlog import same

SIZE = TRUE_LENS.image_size
FLAT = flat_board()
BOARD = FLAT.boards[0]
TRUE = synthetic_corners(FLAT, poses_around(FLAT, 3), noise=0.1)
NAMES = ("Image03.tif", "Image04.tif", "Image07.tif")


def cells(photo: int) -> dict[tuple[int, int], np.ndarray]:
    here = np.flatnonzero(TRUE.image == photo)
    return {(int(TRUE.column[i]), int(TRUE.row[i])): TRUE.pixel[i] for i in here}


def renamed(corners: Observations, names: tuple[str, ...]) -> Observations:
    return replace(corners, images=names)


def calib_data(**changes: object) -> dict[str, object]:
    """As click_calib.m saves it: Y falls along a grid, from the corner that is clicked first."""
    record: dict[str, object] = {
        "calib_name": "Image", "format_image": "tif", "image_numbers": [[3, 4, 7, 8]],
        "type_numbering": 1, "N_slots": 2, "n_ima": 4, "nx": SIZE[0], "ny": SIZE[1],
        "active_images": [[1, 1, 1, 0]], "dX": 30.0, "map": np.zeros((256, 3)), "kept": {"a": 1},
    }  # fmt: skip
    column, row = (a.ravel() for a in np.meshgrid(range(BOARD.columns), range(BOARD.rows)))
    for number in range(4):
        there = cells(min(number, 2))
        pixel = [there.get(one, np.array([np.nan] * 2)) for one in zip(column, row, strict=True)]
        record[f"x_{number + 1}"] = np.array(pixel).T
        up = (BOARD.rows - 1 - row) * 30.0
        record[f"X_{number + 1}"] = np.stack([column * 30.0, up, 0.0 * up])
    return {**record, **changes}


def mat(compressed: bool = False, **changes: object) -> bytes:
    file = io.BytesIO()
    savemat(file, calib_data(**changes), do_compression=compressed)
    return file.getvalue()


def photonvision(**changes: object) -> dict[str, object]:
    observations = []
    for photo, name in enumerate(NAMES):
        there = cells(photo)
        observations.append({
            "locationInObjectSpace": [
                {"x": np.float32(0.0254 * c).item(), "y": np.float32(0.0254 * r).item(), "z": 0.0}
                for c, r in there
            ] + [{"x": -1.0, "y": -1.0, "z": 0.0}],
            "locationInImageSpace": [{"x": x, "y": y} for x, y in [*there.values(), (-1.0, -1.0)]],
            "snapshotName": name,
            "snapshotData": {"rows": 1, "data": "aGVsbG8="},
        })  # fmt: skip
    size = dict(zip(("width", "height"), map(float, SIZE), strict=True))
    return {"resolution": size, "observations": observations, **changes}


@pytest.mark.parametrize("compressed", [False, True])
def test_bouguets_corners_are_the_true_ones(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "calib_data.mat"
    path.write_bytes(mat(compressed))
    read = read_corner_files([path], FLAT)
    same(read.corners, renamed(TRUE, NAMES))
    assert read.empty == ("Image08.tif",)
    assert read.left_out == 3 * BOARD.columns * BOARD.rows - len(TRUE.pixel)
    path.write_bytes(mat(type_numbering=0))
    assert read_corner_files([path], FLAT).corners.images[0] == "Image3.tif"


def test_photonvisions_corners_are_the_true_ones(tmp_path: Path) -> None:
    path = tmp_path / "photon.json"
    path.write_text(json.dumps(photonvision()))
    read = read_corner_files([path], FLAT)
    same(read.corners, renamed(TRUE, NAMES))
    assert read.left_out == 3
    record = photonvision()
    record["observations"][0]["cornersUsed"] = [False] + [True] * len(cells(0))
    record["observations"][2]["includeObservationInCalibration"] = False
    path.write_text(json.dumps(record))
    fewer = read_corner_files([path], FLAT)
    assert len(fewer.corners.pixel) == len(TRUE.pixel) - 1 - len(cells(2))
    assert fewer.empty == NAMES[2:]
    assert read_corner_files([path], FLAT, only="*4*").corners.images == NAMES[1:2]


def test_the_size_of_the_photos_is_the_files_or_given(tmp_path: Path) -> None:
    path = tmp_path / "calib_data.mat"
    path.write_bytes(mat(nx=[], ny=[]))
    with pytest.raises(UsageError, match="does not say how large the photos are: add --size WxH"):
        read_corner_files([path], FLAT)
    assert read_corner_files([path], FLAT, image_size=SIZE).corners.image_size == SIZE
    path.write_bytes(mat())
    with pytest.raises(CorrespondenceError, match=r"photos have \d+x\d+ pixels, not 9999x20"):
        read_corner_files([path], FLAT, image_size=(9999, 20))


def bomb() -> bytes:
    packed = zlib.compress(struct.pack("<II", 14, 2**31 - 8) + b"\0" * 110_000_000)
    return mat()[:128] + struct.pack("<II", 15, len(packed)) + packed


X = calib_data()["X_1"]
REFUSED = {
    "v73.mat": (b"MATLAB 7.3 MAT-file".ljust(126) + b"IM\0\0", "is no MAT-file of version 5 to 7"),
    "inactive.mat": (mat(active_images=[[0, 0, 0, 0]]), "no corner in it is declared as found"),
    "flags.mat": (
        mat()[:128] + struct.pack("<6I", 14, 16, 6, 0, 0, 0),
        "is damaged: was it copied whole?",
    ),
    "cut.mat": (mat()[:-100], "is damaged: was it copied whole?"),
    "cut_packed.mat": (mat(True)[:-100], "is damaged: was it copied whole?"),
    "bomb.mat": (bomb(), "holds more than 100 MB"),
    "none.mat": (mat()[:128], "holds no corners"),
    "shape.mat": (mat(x_1=np.zeros((3, 4))), "x_1 and X_1 are not 2xN and 3xN"),
    "few.mat": (mat(x_1=np.zeros((2, 6)), X_1=np.zeros((3, 6))), "'Image03.tif': 6 corners, and"),
    "other.mat": (
        mat(**{f"X_{n}": X[[1, 0, 2]] for n in range(1, 5)}),
        "its board has 8x11 corners, and 'board' of the target",
    ),
    "uneven.mat": (mat(X_1=X + np.pad([[7.0]], ((0, 2), (0, X.shape[1] - 1)))), "no even grid"),
    "huge.mat": (mat(X_1=X * 1e300), "column 0, row 0 of board 'board' is there twice"),
    "size.mat": (mat(nx=-4), "nx and ny must be two whole numbers"),
    "outside.mat": (mat(nx=9), "'Image03.tif': x "),
    "names.mat": (mat(image_numbers=[[3, 3, 7, 8]]), "two of its photos are called the same"),
    "empty.json": (b'{"observations": []}', "has no observations"),
    "text.json": (b'{"observations": ["a"]}', "observations.0 must hold keys and values"),
    "points.json": (
        b'{"observations": [{"locationInObjectSpace": 3}]}',
        "observations.0.locationInObjectSpace must hold",
    ),
    "nan.json": (b'{"observations": [NaN]}', "NaN is not a finite number"),
    "unlike.json": (
        b'{"observations": [{"locationInObjectSpace": [{"x": 1, "y": 2}], "locationInImageSpace": '
        b"[]}]}",
        "observations.0 has 1 places and 0 pixels",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_file_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    data, says = REFUSED[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CubicfishError) as refusal:
        read_corner_files([tmp_path / name], FLAT)
    assert says in str(refusal.value)
    assert name in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_of_countless_arrays_is_refused(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(board_tables, "MAX_ARRAYS", 5)
    (tmp_path / "a.mat").write_bytes(mat())
    with pytest.raises(CorrespondenceError, match="holds more than 5 arrays"):
        read_corner_files([tmp_path / "a.mat"], FLAT)


@given(st.integers(128, len(mat()) - 1), st.binary(max_size=8), st.booleans())
def test_a_damaged_file_is_read_or_refused(tmp_path_factory, at: int, raw: bytes, packed) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.mat"
    data = mat(packed)
    path.write_bytes(data[: at % len(data)] + raw + data[at % len(data) + len(raw) :])
    said = ""
    try:
        read_corner_files([path], FLAT)
    except CubicfishError as refusal:
        said = str(refusal)
    assert "\n" not in said
