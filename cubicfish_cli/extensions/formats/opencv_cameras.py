"""OpenCV's FileStorage, as YAML, XML or JSON, with a camera matrix and distortion coefficients.

There are no standard names. Here case and underscores do not matter: ``camera_matrix``, ``K``,
``intrinsics``, ``mtx`` and others, ``distortion_coefficients``, ``D``, ``distCoeffs``, ``dist`` and
others are read, with a camera's name before or behind them (``M1``, ``D1``, ``left_matrix``), or
inside a mapping of that name. Four coefficients may be those of the fisheye module or of the
pinhole lens: ``model`` or ``distortion_model`` say which, ``fisheye_model`` with 0 or 1, or the
user. With ``xi`` it is cv2.omnidir's lens. Written files say
``model: fisheye``.

YAML, XML and JSON are read as the same plain data: in all three a matrix is a mapping with
``rows``, ``cols``, ``dt`` and ``data``, and its type (``!!opencv-matrix``, ``type_id``) is ignored.
"""

import re
from collections.abc import Iterable, KeysView, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from cubicfish import CameraFileError, FloatArray, quoted
from cubicfish.files import parse_plain_yaml, read_text
from cubicfish.models import Lens, RadialCamera
from cubicfish_cli.extensions.formats.colmap_cameras import ThinPrismLens
from cubicfish_cli.extensions.formats.lenses import (
    PINHOLE,
    PinholeLens,
    UnifiedLens,
    matrix_rows,
    named_in_matrix,
    named_lens,
)
from cubicfish_cli.foreign.file_contents import (
    Fields,
    LensRig,
    PlacedLens,
    chosen_camera,
    numbers,
    parse_plain_json,
    size,
)

# Names in lower case, without underscores or hyphens.
_KEY = re.compile(r"(?:^|[{,])[ \t]*[\"']?(\w{1,40})[\"']?[ \t]*:", re.MULTILINE)
_MATRIX = (
    "cameramatrix", "k", "intrinsics", "intrinsicmatrix", "intrinsic", "cameraintrinsics",
    "cameramat", "cammatrix", "mtx", "kmatrix", "m", "matrix",
)  # fmt: skip
_COEFFICIENTS = (
    "distortioncoefficients", "d", "distcoeffs", "distcoeff", "distcoefs", "distcoef",
    "distortioncoeffs", "distortioncoeff", "distortionparameters", "distortion", "dist",
)  # fmt: skip
_WIDTH = ("imagewidth", "width", "imgwidth", "framewidth")
_HEIGHT = ("imageheight", "height", "imgheight", "frameheight")
# Not shapes: numpy's have the height first.
_SIZE = ("imagesize", "imgsize", "framesize", "resolution")
_MODEL = ("model", "distortionmodel", "lensmodel", "projectionmodel")
_FLAG = ("fisheyemodel", "fisheye", "isfisheye", "usefisheye")
_PINHOLE = (
    "pinhole", "plumb_bob", "radtan", "perspective", "rational_polynomial", "rational", "opencv",
    "brown_conrady", "standard", "normal",
)  # fmt: skip
_FISHEYE = (
    "fisheye", "equidistant", "kannala_brandt", "kannala_brandt4", "kb4", "opencv_fisheye",
)  # fmt: skip
_COUNTS = (0, 4, 5, 8, 12, 14)

_MAX_DEPTH = 12


def opencv_text(one: PlacedLens) -> str:
    """Write a radial lens as FileStorage YAML, for cv2.fisheye."""
    width, height = one.lens.image_size
    return "\n".join(
        [
            *_write_head(one.note),
            f"image_width: {width}",
            f"image_height: {height}",
            *_write_lens(one.lens, "camera_matrix", "distortion_coefficients"),
            "",
        ]
    )


def opencv_stereo_text(rig: LensRig) -> str:
    """Write two radial lenses as FileStorage YAML, for cv2.fisheye's stereo functions.

    It holds M1, D1, M2, D2, and R, T with X2 = R X1 + T in the rig's units; for a rectified pair
    also R1, R2, P1, P2 and Q of :class:`~cubicfish_cli.foreign.file_contents.FlatPair`.

    Raises:
        CameraFileError: the rig has more cameras than two.

    """
    if len(rig.lenses) != 2:
        names = ",".join(one.name for one in rig.lenses[:2])
        raise CameraFileError(
            f"OpenCV's stereo files hold two cameras, and the rig has {len(rig.lenses)}: name two "
            f"with --pair, such as --pair {names}"
        )
    note = [f"{one.name}: {line}" for one in rig.lenses for line in one.note]
    lines = _write_head([*note, f"T, P1, P2 and Q are in {rig.units or 'units of the target'}"])
    for number, one in enumerate(rig.lenses, start=1):
        width, height = one.lens.image_size
        lines += [f"image_width{number}: {width}", f"image_height{number}: {height}"]
        lines += _write_lens(one.lens, f"M{number}", f"D{number}")
    turn, shift = rig.between(1, 0)
    lines += _write_matrices({"R": turn, "T": shift[:, None]})
    if rig.flat is not None:
        width, height = rig.flat.size
        lines += [f"rectified_width: {width}", f"rectified_height: {height}"]
        (R1, R2), (P1, P2) = rig.flat.rotations, rig.flat.projections
        lines += _write_matrices({"R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": rig.flat.Q})
    return "\n".join([*lines, ""])


def _write_head(note: Sequence[str]) -> list[str]:
    return ["%YAML:1.0", "---", *(f"# {line}" for line in note), "model: fisheye"]


def _write_lens(lens: RadialCamera, matrix: str, coefficients: str) -> list[str]:
    return _write_matrices({matrix: np.array(matrix_rows(lens)), coefficients: lens.k[:, None]})


def _write_matrices(named: Mapping[str, FloatArray]) -> list[str]:
    lines = []
    for name, matrix in named.items():
        rows, columns = matrix.shape
        lines += [f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}"]
        data = ", ".join(map(repr, matrix.ravel().tolist()))
        lines += ["   dt: d", f"   data: [ {data} ]"]
    return lines


def looks_like_opencv(text: str) -> bool:
    """Return whether YAML or JSON of no other format has a camera matrix under a known name."""
    keys = dict.fromkeys(found[1] for found in _KEY.finditer(text))
    matrices, coefficients = (_list_rests(keys, names) for names in (_MATRIX, _COEFFICIENTS))
    return text.startswith("%YAML:1.0") or "" in matrices or not coefficients.isdisjoint(matrices)


def read_opencv(
    path: Path,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    lens: str | None = None,
) -> Lens:
    """Read one camera of a FileStorage file.

    Args:
        path: the file.
        camera: the part of the camera's keys that the others' lack, such as 1 of M1 and D1; not
            needed for a file of one camera.
        image_size: (width, height) of the photos, if the file does not say.
        lens: ``fisheye`` or ``pinhole``, if the file does not say.

    Raises:
        CameraFileError: the file is not one, or holds no camera; one line.

    """
    record = read_file_storage(path)
    cameras = _find_cameras(record)
    if not cameras:
        there = ", ".join(quoted(key)[1:-1] for key in [*record][:10])
        raise CameraFileError(
            f"{path} has no camera matrix under a name that is known, such as camera_matrix or K "
            f"beside distortion_coefficients or D: it holds {there or 'nothing'}"
        )
    camera = chosen_camera(path, cameras, camera)
    if isinstance(record.get(camera), dict):
        record, camera = {**record, **record[camera]}, ""
    keys = _Keys(path, record, camera)
    name, matrix = _read_matrix(keys)
    d = _read_coefficients(keys, name)
    photos = _read_size(keys) or image_size
    if photos is None:
        raise CameraFileError(f"{path} does not say how large the photos are: add --size WxH")
    named = named_in_matrix(matrix) | dict(zip(PINHOLE, d, strict=False))
    xi = keys.find(("xi",))
    if xi is None and not _is_fisheye(keys, len(d), lens):
        return named_lens(path, PinholeLens, photos, named)
    if len(d) != 4:
        raise CameraFileError(f"{path}: a fisheye lens has 4 distortion coefficients, not {len(d)}")
    skew = float(matrix[1])
    if xi is not None:
        named |= {"xi": float(keys.numbers(xi, (1,))[0]), "skew": skew}
        return named_lens(path, UnifiedLens, photos, named)
    named |= dict(zip(("k1", "k2", "k3", "k4"), d, strict=True))
    model = ThinPrismLens if skew else RadialCamera
    return named_lens(path, model, photos, {**named, "skew": skew})


def _find_cameras(record: Mapping[str, Any]) -> Sequence[str]:
    """Return names of cameras: what stands before or behind the names of a lens, or around them.

    A camera whose keys have nothing more than those of a lens is called "".
    """
    arrays = [key for key, value in record.items() if isinstance(value, dict | list)]
    matrices, coefficients = (_list_rests(arrays, names) for names in (_MATRIX, _COEFFICIENTS))
    found = [name for name in matrices if name in coefficients]
    found += [key for key, one in record.items() if isinstance(one, dict) and _find_cameras(one)]
    return [""] if "" in found or ("" in matrices and not found) else found


def _list_rests(keys: Iterable[str], names: Sequence[str]) -> KeysView[str]:
    """Return what keys hold before or behind one of the names, in their order."""
    plain = [*map(_normalise_key, keys)]
    before = [key.removesuffix(name) for key in plain for name in names if key.endswith(name)]
    behind = [key.removeprefix(name) for key in plain for name in names if key.startswith(name)]
    return dict.fromkeys([*before, *behind]).keys()


def _read_row(path: Path, name: str, value: Any) -> Any:
    """Return the numbers of a matrix, or of nested lists, row by row; a number as a list."""
    if isinstance(value, dict):
        return _read_matrix_data(path, name, value)
    if isinstance(value, list) and value and all(isinstance(row, list) for row in value):
        return [one for row in value for one in row]
    return _in_list(value)


def _read_matrix_data(path: Path, name: str, value: Mapping[str, Any]) -> Any:
    """Return the numbers of a mapping with ``rows``, ``cols`` and ``data``."""
    data: Any = value.get("data")
    rows: Any = value.get("rows")
    columns: Any = value.get("cols")
    if isinstance(data, str) and data.startswith("$base64$"):
        raise CameraFileError(
            f"{path}: {quoted(name)} is packed in base 64: write the file without WRITE_BASE64"
        )
    data = [] if data is None else _in_list(data)  # as XML has lists of none
    counted = isinstance(rows, int) and isinstance(columns, int)
    if counted and isinstance(data, list) and rows * columns != len(data):
        raise CameraFileError(
            f"{path}: {quoted(name)} holds {len(data)} numbers, not rows times cols"
        )
    return data


def _in_list(value: Any) -> Any:
    """Return a number in a list, as XML has lists of one, and anything else as it is."""
    return [value] if isinstance(value, int | float) else value


@dataclass(frozen=True, eq=False)
class _Keys:
    """The keys of a file in any spelling, or those of one camera if one is named."""

    path: Path
    record: Mapping[str, Any]
    camera: str

    def find(self, names: Sequence[str], *, arrays: bool = False) -> tuple[str, Any] | None:
        """Find the key and value of one of the names: the camera's own, or one for all cameras.

        With ``arrays`` it must be the camera's own, and no single number or word: a file may hold
        the number k1 beside the matrix K1.

        Raises:
            CameraFileError: several have, and hold different values.

        """
        one = _normalise_key(self.camera)
        own = [*(name + one for name in names), *(one + name for name in names)]
        for spellings in (own,) if arrays else (own, names):
            found = [
                (key, value)
                for key, value in self.record.items()
                if _normalise_key(key) in spellings
                and (not arrays or isinstance(value, dict | list))
            ]
            for other, value in found[1:]:
                if value != found[0][1]:
                    raise CameraFileError(
                        f"{self.path}: {quoted(found[0][0])} and {quoted(other)} are not the same: "
                        "leave one of them"
                    )
            if found:
                return found[0]
        return None

    def numbers(self, entry: tuple[str, Any], counts: tuple[int, ...]) -> FloatArray:
        """Return the numbers of a key that was found, as many as one of ``counts``."""
        return numbers(self.path, _read_row(self.path, *entry), entry[0], counts)


def _read_matrix(keys: _Keys) -> tuple[str, FloatArray]:
    entry = keys.find(_MATRIX, arrays=True)
    if entry is None:
        raise CameraFileError(f"{keys.path}: {quoted(keys.camera)} has no camera matrix")
    matrix = keys.numbers(entry, (9,))
    if matrix[[3, 6, 7, 8]].tolist() != [0, 0, 0, 1]:
        raise CameraFileError(
            f"{keys.path}: {quoted(entry[0])} is not of the form fx, skew, cx, 0, fy, cy, 0, 0, "
            "1: was it written column by column?"
        )
    return entry[0], matrix


def _read_coefficients(keys: _Keys, matrix: str) -> list[float]:
    entry = keys.find(_COEFFICIENTS, arrays=True)
    if entry is None:
        raise CameraFileError(
            f"{keys.path} has no distortion coefficients that go with {quoted(matrix)}: name them "
            "distortion_coefficients, or D"
        )
    return keys.numbers(entry, _COUNTS).tolist()


def _read_size(keys: _Keys) -> tuple[int, int] | None:
    width, height, both = keys.find(_WIDTH), keys.find(_HEIGHT), keys.find(_SIZE)
    if width is not None and height is not None:
        return size(keys.path, width[1], height[1], f"{width[0]} and {height[0]}")
    if both is None:
        return None
    if isinstance(both[1], dict) and "width" in both[1]:
        return Fields.of(keys.path, keys.record).part(both[0]).size("width", "height")
    across, down = keys.numbers(both, (2,))
    return size(keys.path, across, down, both[0])


def _is_fisheye(keys: _Keys, count: int, lens: str | None) -> bool:
    said = _read_lens(keys)
    if lens is not None and said not in (None, lens):
        raise CameraFileError(f"{keys.path} says that its lens is a {said}'s: leave out --lens")
    if said is None and lens is None and count == 4:
        raise CameraFileError(
            f"{keys.path}: four distortion coefficients are a fisheye's or a pinhole's: say which "
            "with --lens fisheye or --lens pinhole"
        )
    return "fisheye" in (said, lens)


def _read_lens(keys: _Keys) -> str | None:
    """Return whose the coefficients are as the file says, fisheye or pinhole."""
    flag, model = keys.find(_FLAG), keys.find(_MODEL)
    if flag is not None:
        if not isinstance(flag[1], int) or flag[1] not in (0, 1):  # true and false are
            raise CameraFileError(f"{keys.path}: {quoted(flag[0])} must be 0 or 1")
        return "fisheye" if flag[1] else "pinhole"
    if model is None:
        return None
    kind = str(model[1]).strip().lower().replace("-", "_")
    if kind in _FISHEYE or kind in _PINHOLE:
        return "fisheye" if kind in _FISHEYE else "pinhole"
    raise CameraFileError(
        f"{keys.path}: {quoted(model[0])} {quoted(str(model[1]))} is not known: "
        f"{', '.join((*_FISHEYE, *_PINHOLE))}"
    )


def _normalise_key(key: str) -> str:
    return re.sub(r"[^a-z0-9]", "", key.lower())


MAX_BYTES = 4_000_000
# OpenCV writes no longer numbers, and they would be slow to read.
_LONGEST_NUMBER = 300
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
_ROOTS = ("opencv_storage", "calibration")


def read_file_storage(path: Path) -> Mapping[str, Any]:
    """Read a FileStorage file: mappings, lists, text, numbers.

    Raises:
        CameraFileError: the file cannot be read, is larger than 4 MB, is none of the three, has
            a key twice, or is more than plain data (entities, anchors); one line.

    """
    text = read_text(path, max_bytes=MAX_BYTES, error=CameraFileError)
    start = text.lstrip()[:1]
    if start == "<":
        data = _parse_xml(path, text)
    elif start == "{":
        data = parse_plain_json(path, text)
    else:
        text = re.sub(r"\A%YAML[: ]1\.[0-9].*\n", "", text)
        text = re.sub(r"!!opencv-(?:nd-)?matrix\b", "", text)
        data = parse_plain_yaml(path, text, error=CameraFileError)
    return dict(Fields.of(path, data, "the file").values)


def _parse_xml(path: Path, text: str) -> Any:
    if re.search("<!(?:DOCTYPE|ENTITY)", text):
        raise CameraFileError(
            f"{path}: document types and entities (<!DOCTYPE, <!ENTITY) are not allowed: plain "
            "data only"
        )
    try:
        root = ElementTree.fromstring(text.lstrip())
    except ElementTree.ParseError as problem:
        what = expat.ErrorString(problem.code)
        raise CameraFileError(
            f"{path}, line {problem.position[0]}: not valid XML: {what}"
        ) from problem
    if root.tag not in _ROOTS:
        raise CameraFileError(
            f"{path}: the outermost element is {quoted(root.tag)}, not {' or '.join(_ROOTS)}: is "
            "it OpenCV's FileStorage, or Metashape's?"
        )
    return _read_element(path, root, 1)


def _read_element(path: Path, element: ElementTree.Element, depth: int) -> Any:
    """Return an element's content: a mapping, a list if children are called ``_``, or a value."""
    name = quoted(element.tag)
    if depth > _MAX_DEPTH:
        raise CameraFileError(f"{path}: nested more than {_MAX_DEPTH} levels deep")
    text = "".join([element.text or "", *(child.tail or "" for child in element)]).strip()
    if not len(element):
        # A storage without anything is a mapping, and anything else without anything nothing.
        return _parse_values(text) if depth > 1 or text else {}
    names = [child.tag for child in element]
    is_list = set(names) == {"_"}
    if text or (not is_list and ("_" in names or len(set(names)) < len(names))):
        raise CameraFileError(
            f"{path}: {name} holds text, a list and names beside each other, or a name twice"
        )
    values = [_read_element(path, child, depth + 1) for child in element]
    return values if is_list else dict(zip(names, values, strict=True))


def _parse_values(text: str) -> Any:
    """Return a number, a list of numbers, or text."""
    words = text.split()
    if not words:
        return None
    if all(len(word) <= _LONGEST_NUMBER and _NUMBER.fullmatch(word) for word in words):
        values = [float(word) if set(word) & set(".eE") else int(word) for word in words]
        return values[0] if len(values) == 1 else values
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text
