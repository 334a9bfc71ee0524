"""Corners with their places on a board: Bouguet's ``calib_data.mat``, and PhotonVision's JSON.

Both count pixels from the middle of the first one.

- Bouguet's Camera Calibration Toolbox for MATLAB has ``x_1`` (2, N), pixels, and ``X_1`` (3, N), on
  the board, for each photo; a photo that it leaves out is 0 in ``active_images``. On the board Y
  goes up: its grids begin at the largest Y.
- PhotonVision has ``observations``, each with ``locationInObjectSpace`` and
  ``locationInImageSpace``, x along the board's rows and y down; a corner that was not found is
  below 0, and one that does not fit is false in ``cornersUsed``.
"""

import re
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cubicfish import CorrespondenceError, FloatArray, Observations, Target, UsageError, quoted
from cubicfish.files import read_bytes, read_text
from cubicfish_cli.foreign.file_contents import Fields, numbers, parse_plain_json, size

MAX_BYTES = 100_000_000
# Places on a board are multiples of its squares to such a share of one; shares of a board below the
# other are no distance.
_NEAR = 0.01
_SAME = 1e-6
_MOST = 10_000  # cells along a side
MAX_ARRAYS = 100_000
# What is read of a MAT-file.
_ARRAY = re.compile(
    r"(?:x|X)_\d{1,6}|nx|ny|active_images|calib_name|format_image|image_numbers|N_slots|"
    r"type_numbering"
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shot:
    """The corners of a photo: places on the board (N, 2), y down, and pixels (N, 2).

    Those that are not there have pixels below 0, or NaN.
    """

    name: str
    place: FloatArray
    pixel: FloatArray


def read_calib_data(
    path: Path, target: Target, board: int, image_size: tuple[int, int] | None, only: str
) -> tuple[Observations, int]:
    """Read the corners of a calib_data.mat, of a board of the target.

    Raises:
        UsageError: the size of the photos is not known.
        CorrespondenceError: the file cannot be used, or is about another board; one line.

    """
    values, one = read_mat(path), target.boards[board]
    active = values.get("active_images", np.zeros(0)).ravel()
    shots = []
    for number in sorted(int(key[2:]) for key in values if re.fullmatch(r"x_\d{1,6}", key)):
        pixel, place = values[f"x_{number}"].T, values.get(f"X_{number}", np.zeros(0)).T
        if pixel.ndim != 2 or pixel.shape[1] != 2 or place.shape != (len(pixel), 3):
            raise CorrespondenceError(f"{path}: x_{number} and X_{number} are not 2xN and 3xN")
        name, is_clicked = _name_shot(values, number), np.isfinite(place).all()
        if is_clicked and len(place) != one.columns * one.rows:
            raise CorrespondenceError(
                f"{path}, {quoted(name)}: {len(place)} corners, and {quoted(one.name)} of the "
                f"target has {one.columns}x{one.rows}: does the target say how many there are?"
            )
        if 0 < number <= len(active) and active[number - 1] == 0:
            pixel = np.full_like(pixel, np.nan)
        there = np.stack([place[:, 0], place[:, 1].max(initial=0) - place[:, 1]], axis=-1)
        shots.append(_Shot(name=name, place=there, pixel=pixel))
    width, height = (values.get(key, _NO).ravel().tolist() for key in ("nx", "ny"))
    photos = size(path, width[0], height[0], "nx and ny") if width and height else image_size
    return _name_corners(path, target, board, photos, only, shots)


_NO = np.zeros(0)


def _name_shot(values: Mapping[str, FloatArray], number: int) -> str:
    """Return the name of a photo, as the toolbox reads it."""
    name, ending = (_read_word(values, key) for key in ("calib_name", "format_image"))
    numbered = values.get("image_numbers", _NO).ravel()
    there = numbered[number - 1] if number <= len(numbered) else number
    digits = int(there) if abs(there) < 1e9 else number
    slots = values.get("N_slots", _NO)
    width = int(slots.flat[0]) if values.get("type_numbering", _NO).any() and slots.size else 0
    return f"{name or 'image'}{digits:0{min(max(width, 0), 9)}}{'.' + ending if ending else ''}"


def _read_word(values: Mapping[str, FloatArray], key: str) -> str:
    codes = values.get(key, _NO).ravel()[:200]
    letters = (chr(int(code)) for code in codes if 0 < code < 0x10000)
    return "".join(letter for letter in letters if letter.isprintable())


def read_photonvision(
    path: Path, target: Target, board: int, image_size: tuple[int, int] | None, only: str
) -> tuple[Observations, int]:
    """Read the corners of PhotonVision's calibration, of a board of the target.

    Raises:
        UsageError: the size of the photos is not known.
        CubicfishError: the file cannot be used, or is about another board; one line.

    """
    text = read_text(path, max_bytes=MAX_BYTES, error=CorrespondenceError)
    record = Fields.of(path, parse_plain_json(path, text))
    found = record.values.get("observations")
    if not isinstance(found, list) or not found:
        raise CorrespondenceError(
            f"{path} has no observations: is it a calibration of PhotonVision?"
        )
    shots = []
    for number, one in enumerate(found):
        shot = Fields.of(path, one, f"observations.{number}")
        place, pixel = (
            _read_points(path, shot.values.get(key), f"observations.{number}.{key}")
            for key in ("locationInObjectSpace", "locationInImageSpace")
        )
        if len(place) != len(pixel):
            raise CorrespondenceError(
                f"{path}: observations.{number} has {len(place)} places and {len(pixel)} pixels"
            )
        used = shot.values.get("cornersUsed")
        if isinstance(used, list) and len(used) == len(pixel):
            pixel[[one is False for one in used]] = np.nan
        if shot.values.get("includeObservationInCalibration") is False:
            pixel[:] = np.nan
        name = str(shot.values.get("snapshotName") or f"observation {number}")
        shots.append(_Shot(name=name, place=place, pixel=pixel))
    given = record.values.get("resolution")
    photos = record.part("resolution").size("width", "height") if given else image_size
    return _name_corners(path, target, board, photos, only, shots)


def _read_points(path: Path, value: Any, key: str) -> FloatArray:
    points = value if isinstance(value, list) else [None]
    flat = [one.get(axis) if isinstance(one, dict) else None for one in points for axis in "xy"]
    return numbers(path, flat, key, (len(flat),)).reshape(-1, 2)


def _name_corners(
    path: Path,
    target: Target,
    board: int,
    photos: tuple[int, int] | None,
    only: str,
    shots: Sequence[_Shot],
) -> tuple[Observations, int]:
    """Give corners their names on the board; count those that are not there."""
    if not shots:
        raise CorrespondenceError(f"{path} holds no corners: is it the right file?")
    if photos is None:
        raise UsageError(f"{path} does not say how large the photos are: add --size WxH")
    names = tuple(shot.name for shot in shots)
    if len({*names}) < len(names):
        raise CorrespondenceError(f"{path}: two of its photos are called the same")
    place = np.concatenate([shot.place for shot in shots])
    pixel = np.concatenate([shot.pixel for shot in shots])
    image = np.repeat(np.arange(len(shots)), [len(shot.pixel) for shot in shots])
    wanted = np.array([fnmatchcase(name, only) for name in names], bool)[image]
    with np.errstate(invalid="ignore"):
        found = (pixel > -0.5).all(axis=1) & np.isfinite(place).all(axis=1)
    column, row = _find_cells(path, target, board, place[found])
    boards = np.full(len(column), board, np.intp)
    every = Observations(
        image_size=photos,
        images=names,
        boards=target.board_names,
        image=image[found],
        board=boards,
        column=column,
        row=row,
        pixel=pixel[found],
        weight=np.ones(len(column)),
        world=target.world_points(boards, column, row),
        target=target,
    )

    def refuse(corner: int, what: str) -> NoReturn:
        raise CorrespondenceError(f"{path}, {quoted(names[image[found][corner]])}: {what}")

    left_out = ~found & wanted & np.isin(image, image[found])
    return every.usable(refuse).select(wanted[found]), int(left_out.sum())


def _find_cells(path: Path, target: Target, board: int, place: FloatArray) -> Any:
    """Return columns and rows of places on the board, in the file's own unit."""
    one = target.boards[board]
    if not len(place):
        return np.zeros((2, 0), np.intp)
    cells, counts = [], []
    for along in place.T:
        steps = np.diff(np.unique(along))
        # Whatever their last digits are, equal places are one.
        square = np.min(steps[steps > _SAME * np.ptp(along)], initial=np.inf)
        cell = along / square if len(steps) else along
        is_grid = (np.abs(cell - np.clip(np.round(cell), 0, _MOST)) < _NEAR).all()
        cells.append((np.round(cell) if is_grid else np.zeros_like(cell)).astype(np.intp))
        counts.append(int(cells[-1].max()) + 1 if is_grid else 0)
    if counts != [one.columns, one.rows]:
        what = "{}x{} corners".format(*counts) if all(counts) else "no even grid"
        raise CorrespondenceError(
            f"{path}: its board has {what}, and {quoted(one.name)} of the target "
            f"{one.columns}x{one.rows}: does the target say how many there are?"
        )
    return cells


# MAT-files ---------------------------------------------------------------------------------------

_MATRIX, _COMPRESSED = 14, 15
_TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
    16: "u1", 17: "u2",
}  # fmt: skip


def read_mat(path: Path) -> dict[str, FloatArray]:
    """Return arrays of numbers and letters of a MAT-file (version 5 to 7) by their names.

    Nothing else in it is looked at, and no more than :data:`MAX_BYTES` of it are unpacked.

    Raises:
        CorrespondenceError: it is of another version, damaged or too large; one line.

    """
    data = read_bytes(path, max_bytes=MAX_BYTES, error=CorrespondenceError)
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None or not data.startswith(b"MATLAB 5.0"):
        raise CorrespondenceError(
            f"{path} is no MAT-file of version 5 to 7: save it with save(..., '-v7')"
        )
    values: dict[str, FloatArray] = {}
    try:
        for number, element in enumerate(_unpack(path, data, order)):
            if number == MAX_ARRAYS:
                raise CorrespondenceError(f"{path} holds more than {MAX_ARRAYS:,} arrays")
            values |= _read_array(element, order)
    except (struct.error, zlib.error, ValueError, LookupError) as problem:
        if isinstance(problem, CorrespondenceError):
            raise
        raise CorrespondenceError(f"{path} is damaged: was it copied whole?") from problem
    return values


def _unpack(path: Path, data: bytes, order: str) -> Iterator[bytes]:
    """Give the contents of a file's arrays."""
    at, left = 128, MAX_BYTES
    while at < len(data):
        kind, length = struct.unpack_from(f"{order}II", data, at)
        element = data[at + 8 : at + 8 + length]
        at += 8 + length
        if kind == _COMPRESSED:
            unpacking = zlib.decompressobj()
            element = unpacking.decompress(element, left)
            left -= len(element)
            if unpacking.unconsumed_tail or left <= 0:
                raise CorrespondenceError(
                    f"{path} holds more than {MAX_BYTES / 1e6:.3g} MB: save it without the photos"
                )
            kind, element = struct.unpack_from(f"{order}I", element)[0], element[8:]
        if kind == _MATRIX:
            yield element


def _read_array(data: bytes, order: str) -> dict[str, FloatArray]:
    """Return the values of an array by its name; nothing if it is not one that is wanted."""
    parts, at = [], 0
    for _ in range(4):
        kind, length = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # up to four bytes, beside their type
            kind, length, at = kind & 0xFFFF, kind >> 16, at - 4
        parts.append((kind, data[at + 8 : at + 8 + length]))
        at = -(-(at + 8 + length) // 8) * 8
        if len(parts) == 1 and parts[0][1][0 if order == "<" else 3] not in (4, *range(6, 16)):
            return {}
    (_, shape), (_, name), (kind, values) = parts[1:]
    if not _ARRAY.fullmatch(name.decode()):
        return {}
    sides = np.frombuffer(shape, f"{order}i4")
    flat = np.frombuffer(values, order + _TYPES[kind]).astype(float)
    return {name.decode(): flat.reshape(sides.tolist(), order="F")}
