"""Contents of other tools' camera files: lenses with their places, and checked values.

The files are untrusted: reading is bounded, and errors have one line.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from cubicfish import CameraFileError, FloatArray, quoted
from cubicfish.files import read_text
from cubicfish.target import MILLIMETRES

Pose = tuple[FloatArray, FloatArray]
"""Rotation (3, 3) and translation (3,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedLens:
    """A lens and where it stands: by default alone, in its own frame.

    Attributes:
        name: of the camera.
        lens: the :class:`~cubicfish.models.lens.Lens`, of the model that the format holds.
        note: how it was made, a line each.
        rotation: (3, 3) of lens_from_rig.
        translation: (3,) of lens_from_rig, in the rig's units.
        poses: camera_from_world of its photos, in the lens's frame, by the photo's name.

    """

    name: str = "camera"
    lens: Any
    note: Sequence[str] = ()
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))
    poses: Mapping[str, Pose] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatPair:
    """A rectified pair: flat pictures of two lenses with common rows, as of cv2.stereoRectify.

    Attributes:
        size: (width, height) of the flat pictures.
        rotations: of the two: (3, 3) rectified_from_lens.
        projections: of the two: (3, 4), of points in the first's rectified frame.
        Q: (4, 4) takes (column, row, disparity, 1) to a point of the first's rectified frame.

    """

    size: tuple[int, int]
    rotations: tuple[FloatArray, FloatArray]
    projections: tuple[FloatArray, FloatArray]
    Q: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LensRig:
    """A rig as files of other tools hold it.

    Attributes:
        lenses: of the cameras; the first camera's frame is the rig's.
        units: of lengths; None where not known.
        overlaps: (N, N) whether two lenses see some direction in common.
        flat: of two lenses, where flat pictures of both exist.

    """

    lenses: tuple[PlacedLens, ...]
    units: str | None
    overlaps: npt.NDArray[np.bool_]
    flat: FlatPair | None = None

    @property
    def metres(self) -> float:
        """Metres in one unit of length.

        Raises:
            CameraFileError: it is not known which unit that is.

        """
        size = MILLIMETRES.get((self.units or "").lower())
        if size is None:
            what = "says no unit of length" if self.units is None else f"is in {quoted(self.units)}"
            raise CameraFileError(
                f"the rig {what}, and this format is in metres: write units: mm (or cm, m, in, ft) "
                "into rig.yaml"
            )
        return size / MILLIMETRES["m"]

    def between(self, second: int, first: int) -> Pose:
        """second_from_first, (3, 3) and (3,), in the rig's units."""
        a, b = self.lenses[first], self.lenses[second]
        turn = b.rotation @ a.rotation.T
        return turn, b.translation - turn @ a.translation

    def rig_from_lens(self, number: int) -> Pose:
        """Return where a lens stands in the rig: (3, 3) and (3,), in the rig's units."""
        one = self.lenses[number]
        return one.rotation.T, -one.rotation.T @ one.translation


def transform_rows(rotation: FloatArray, translation: FloatArray) -> list[list[float]]:
    """Return the four rows of a 4x4 transform."""
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = rotation, translation
    return (whole + 0.0).tolist()  # no -0.0


MAX_SIDE = 100_000
_LARGEST = 1e100
MAX_VALUES = 2_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Fields:
    """A mapping of a camera's file, whose values are checked when they are read.

    Attributes:
        path: the file, for messages.
        values: the mapping.
        at: what stands before its keys in messages, such as ``cam0.``.

    """

    path: Path
    values: Mapping[str, Any]
    at: str = ""

    @classmethod
    def of(cls, path: Path, data: Any, what: str = "the file") -> Fields:
        """Return the fields of a file's data.

        Raises:
            CameraFileError: the data is no mapping; so do the methods below for wrong values.

        """
        return cls(path=path, values=_refuse_no_mapping(path, data, what))

    def part(self, key: str) -> Fields:
        """Return a mapping within it."""
        inner = _refuse_no_mapping(self.path, self.values.get(key), self.at + key)
        return Fields(path=self.path, values=inner, at=f"{self.at}{key}.")

    def numbers(self, key: str, *counts: int) -> FloatArray:
        """Return a list of finite numbers, as many as one of ``counts``."""
        return numbers(self.path, self.values.get(key), self.at + key, counts)

    def number(self, key: str) -> float:
        """Return one finite number."""
        return float(numbers(self.path, [self.values.get(key)], self.at + key, (1,))[0])

    def name(self, key: str, known: Sequence[str]) -> str:
        """Return one of the names that are known."""
        value = self.values.get(key)
        if value not in known:
            raise CameraFileError(
                f"{self.path}: {self.at}{key} {quoted(str(value))} is not known: {', '.join(known)}"
            )
        return str(value)

    def size(self, width: str, height: str) -> tuple[int, int]:
        """Return (width, height) in pixels, by their keys."""
        given = self.values.get(width), self.values.get(height)
        return size(self.path, *given, f"{self.at}{width} and {self.at}{height}")

    def size_of(self, key: str) -> tuple[int, int]:
        """Return (width, height) in pixels, by the key of both."""
        width, height = self.numbers(key, 2)
        return size(self.path, width, height, self.at + key)


def numbers(path: Path, value: Any, key: str, counts: tuple[int, ...]) -> FloatArray:
    """Return a list of finite numbers, as many as one of ``counts``.

    Raises:
        CameraFileError: it is anything else; ``path`` and ``key`` name it.

    """
    if (
        not isinstance(value, list)
        or len(value) not in counts
        or not all(isinstance(one, int | float) and not isinstance(one, bool) for one in value)
        or not all(abs(one) < _LARGEST for one in value)  # NaN fails this too
    ):
        wanted = " or ".join(map(str, counts))
        raise CameraFileError(f"{path}: {key} must hold {wanted} finite numbers")
    return np.array(value, float)


def size(path: Path, width: Any, height: Any, key: str) -> tuple[int, int]:
    """Return (width, height) in pixels.

    Raises:
        CameraFileError: they are no whole numbers from 1 to :data:`MAX_SIDE`.

    """
    for side in (width, height):
        if isinstance(side, bool) or not isinstance(side, int | float) or side != side:
            raise CameraFileError(f"{path}: {key} must be two whole numbers")
        if not 1 <= side <= MAX_SIDE or side != int(side):
            raise CameraFileError(f"{path}: {key} must be two whole numbers from 1 to {MAX_SIDE}")
    return int(width), int(height)


def chosen_camera(path: Path, there: Sequence[str], camera: str | None) -> str:
    """Return the name of a file's only camera, or of the one that is named.

    Raises:
        CameraFileError: there are several and none is named, or there is none of that name.

    """
    if camera is None and len(there) == 1:
        return there[0]
    if camera is not None and camera in there:
        return camera
    if [*there] == [""]:
        raise CameraFileError(f"{path} holds one camera: leave out --camera")
    names = ", ".join(quoted(one)[1:-1] for one in there[:10]) or "none"
    more = f" and {len(there) - 10} more" if len(there) > 10 else ""
    raise CameraFileError(f"{path}: name one of its cameras with --camera: {names}{more}")


def json_text(data: Any) -> str:
    """Return plain data as the text of a file, finite numbers only."""
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def load_plain_json(path: Path, *, max_bytes: int) -> Fields:
    """Return the mapping in a JSON file of at most ``max_bytes``."""
    return Fields.of(
        path, parse_plain_json(path, read_text(path, max_bytes=max_bytes, error=CameraFileError))
    )


def parse_plain_json(path: Path, text: str) -> Any:
    """Return what the text of a file holds; ``path`` is for messages.

    Raises:
        CameraFileError: it is not JSON, a key is there twice, a number is not one, or there are
            more than :data:`MAX_VALUES`; one line.

    """
    if sum(map(text.count, ",[{")) > MAX_VALUES:
        raise CameraFileError(
            f"{path} holds more than {MAX_VALUES:,} values: is it the right file?"
        )

    def refuse_constant(name: str) -> NoReturn:
        raise CameraFileError(f"{path}: {name} is not a finite number")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        data = dict(pairs)
        if len(data) < len(pairs):
            twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
            raise CameraFileError(f"{path}: the key {quoted(twice)} is there twice")
        return data

    try:
        return json.loads(text, parse_constant=refuse_constant, object_pairs_hook=unique)
    except CameraFileError:
        raise
    except json.JSONDecodeError as problem:
        raise CameraFileError(
            f"{path}, line {problem.lineno}: not valid JSON: {problem.msg}"
        ) from problem
    except (ValueError, RecursionError) as problem:  # a number of many digits; deep nesting
        raise CameraFileError(f"{path}: not the JSON of a camera") from problem


def _refuse_no_mapping(path: Path, value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise CameraFileError(f"{path}: {what} must hold keys and values")
    return value
