"""COLMAP's cameras.txt and cameras.bin, and the rig_config.json of a rig.

The binary file is little-endian: how many cameras (uint64), then for each its CAMERA_ID (uint32),
the model's number (int32), width and height (uint64) and the parameters (float64).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from scipy.spatial.transform import Rotation

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.bounded import read_bounded, read_bounded_bytes
from cubicfish_cli.formats.camera_format import CameraFormat
from cubicfish_cli.formats.colmap_models import MODELS, WRITTEN, lens_of, parameters_of
from cubicfish_cli.formats.fields import size
from cubicfish_cli.formats.lens_rig import LensRig
from cubicfish_cli.formats.plain_json import json_text
from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.wording import did_you_mean, quoted

MAX_BYTES = 16_000_000
_HEAD = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")
_BY_NUMBER = {model.number: name for name, model in MODELS.items()}
_EQUIRECTANGULAR = 17
_LINE = re.compile(r"^[^\S\n]*[0-9]+\s+[A-Z][A-Z_]+\s+[0-9]+\s+[0-9]+\s+[-+.0-9]", re.MULTILINE)


def colmap_text(lens: Lens, note: Sequence[str]) -> str:
    """A lens of one of :data:`colmap_models.WRITTEN`'s models as a cameras.txt of one camera.

    Raises:
        CameraFileError: the lens's values lie outside what COLMAP takes.

    """
    name, parameters = parameters_of(lens)
    width, height = lens.image_size
    return "\n".join(
        [
            "# Camera list with one line of data per camera:",
            "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
            "# Number of cameras: 1",
            *(f"# {line}" for line in note),
            f"1 {name} {width} {height} " + " ".join(map(repr, parameters)),
            "",
        ]
    )


def colmap_rig_text(rig: LensRig) -> str:
    """Lenses of :data:`colmap_models.WRITTEN`'s models as rig_config.json, with their cameras.

    The photos of each camera are in a folder of its name; lengths are the rig's own.

    Raises:
        CameraFileError: a lens's values lie outside what COLMAP takes.

    """
    cameras = []
    for number, one in enumerate(rig.lenses):
        name, parameters = parameters_of(one.lens)
        camera: dict[str, Any] = {
            "image_prefix": f"{one.name}/",
            "camera_model_name": name,
            "camera_params": list(parameters),
        }
        if number:
            turn, shift = rig.between(number, 0)
            x, y, z, w = Rotation.from_matrix(turn).as_quat().tolist()
            camera["cam_from_rig_rotation"] = [w, x, y, z]
            camera["cam_from_rig_translation"] = shift.tolist()
        else:
            camera["ref_sensor"] = True
        cameras.append({**camera, "made_by": list(one.note)})
    return json_text([{"cameras": cameras}])


def looks_like_cameras_txt(text: str) -> bool:
    """Whether a line of the text is one of cameras.txt."""
    return _LINE.search(text) is not None


def looks_like_cameras_bin(data: bytes) -> bool:
    """Whether a file begins as a cameras.bin does: text never has so many zeros there."""
    if len(data) < _HEAD.size + _CAMERA.size:
        return False
    (count,) = _HEAD.unpack_from(data)
    _, model, width, height = _CAMERA.unpack_from(data, _HEAD.size)
    return 0 < count < 2**32 and 0 <= model < 256 and max(width, height) < 2**32


def read_colmap(path: Path, *, camera: str | None = None) -> Lens:
    """Read one camera of a cameras.txt or a cameras.bin.

    Args:
        path: the file.
        camera: its CAMERA_ID; not needed where there is one.

    Raises:
        CameraFileError: the file is neither, or holds no such camera; one line.

    """
    data = read_bounded_bytes(path, max_bytes=MAX_BYTES)
    if looks_like_cameras_bin(data):
        return _read_binary(path, data, camera)
    return _read_text(path, read_bounded(path, max_bytes=MAX_BYTES), camera)


def _chosen(path: Path, there: Sequence[str], camera: str | None) -> str:
    if camera is None and len(there) == 1:
        return there[0]
    if camera is not None and camera in there:
        return camera
    names = ", ".join(quoted(one)[1:-1] for one in there[:10]) or "none"
    more = f" and {len(there) - 10} more" if len(there) > 10 else ""
    raise CameraFileError(f"{path}: name one of its cameras with --camera: {names}{more}")


def _read_text(path: Path, text: str, camera: str | None) -> Lens:
    lines: dict[str, tuple[int, list[str]]] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.split()
        if not cells or cells[0].startswith("#"):
            continue
        if cells[0] in lines:
            raise CameraFileError(
                f"{path}, line {number}: camera {quoted(cells[0])} is there twice"
            )
        lines[cells[0]] = number, cells
    number, cells = lines[_chosen(path, list(lines), camera)]
    where = Path(f"{path}, line {number}")
    name = cells[1] if len(cells) > 1 else "nothing"
    if name not in MODELS:
        raise CameraFileError(
            f"{where}: {quoted(name)} is no camera model that is known here: {_known(name)}"
        )
    try:
        given = [float(cell) for cell in cells[2:]]
    except ValueError as problem:
        raise CameraFileError(f"{where}: what follows the model must be numbers") from problem
    if len(given) < 2:
        raise CameraFileError(f"{where}: WIDTH and HEIGHT must follow the model")
    image_size = size(where, given[0], given[1], "WIDTH and HEIGHT")
    return lens_of(where, name, given[2:], image_size)


def _known(name: str) -> str:
    if name == "EQUIRECTANGULAR":
        return "it is a panorama's, not a lens's"
    near = did_you_mean(name, MODELS)
    return near if near.startswith("did") else "known: " + ", ".join(MODELS)


def _read_binary(path: Path, data: bytes, camera: str | None) -> Lens:
    cameras = {}
    for number, name, image_size, given in _cameras(path, data):
        if number in cameras:
            raise CameraFileError(f"{path}: camera {number} is there twice")
        cameras[number] = name, image_size, given
    name, (width, height), given = cameras[_chosen(path, list(cameras), camera)]
    return lens_of(path, name, given, size(path, width, height, "width and height"))


def _cameras(
    path: Path, data: bytes
) -> Iterator[tuple[str, str, tuple[int, int], tuple[float, ...]]]:
    """CAMERA_ID, model, size and parameters of each camera."""
    (count,) = _HEAD.unpack_from(data)
    at = _HEAD.size
    for index in range(count):
        if at + _CAMERA.size > len(data):
            raise CameraFileError(
                f"{path} ends within camera {index + 1} of {count}: was it copied whole?"
            )
        camera, model, width, height = _CAMERA.unpack_from(data, at)
        at += _CAMERA.size
        if model not in _BY_NUMBER:
            what = _known("EQUIRECTANGULAR" if model == _EQUIRECTANGULAR else "")
            raise CameraFileError(
                f"{path}: camera {camera} is of model number {model}, which is not known here: "
                + what
            )
        name = _BY_NUMBER[model]
        parameters = struct.Struct(f"<{len(MODELS[name].parameters)}d")
        if at + parameters.size > len(data):
            raise CameraFileError(
                f"{path} ends within camera {index + 1} of {count}: was it copied whole?"
            )
        yield str(camera), name, (width, height), parameters.unpack_from(data, at)
        at += parameters.size
    if at != len(data):
        raise CameraFileError(f"{path}: there is more behind its {count} cameras: is it damaged?")


# Most programs that read COLMAP's files take OPENCV_FISHEYE: it is the one without a name.
_LENSES = {
    "colmap" if name == "OPENCV_FISHEYE" else f"colmap-{name.lower().replace('_', '-')}": lens
    for lens, name in WRITTEN.items()
}
FORMAT = CameraFormat(
    lenses=_LENSES,
    file_name="cameras.txt",
    write=lambda lens, note, poses: colmap_text(lens, note),
    read=read_colmap,
    holds_several=True,
    marks=(("CAMERA_ID",),),
    vague=True,
    looks_like=looks_like_cameras_txt,
    binary_looks_like=looks_like_cameras_bin,
    rig=("rig_config.json", colmap_rig_text),
    front_only=dict.fromkeys(_LENSES, "COLMAP"),
)
