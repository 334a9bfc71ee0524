"""Other tools' camera files by name: which lens each holds, how it is written and read."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.bounded import read_bounded, read_bounded_bytes
from cubicfish_cli.formats.colmap_cameras import (
    colmap_rig_text,
    colmap_text,
    looks_like_cameras_bin,
    looks_like_cameras_txt,
    read_colmap,
)
from cubicfish_cli.formats.colmap_models import WRITTEN as COLMAP_MODELS
from cubicfish_cli.formats.gyroflow_json import gyroflow_text
from cubicfish_cli.formats.kalibr_yaml import LENSES as KALIBR_LENSES
from cubicfish_cli.formats.kalibr_yaml import kalibr_rig_text, kalibr_text, read_kalibr
from cubicfish_cli.formats.lens_rig import LensRig
from cubicfish_cli.formats.mrcal_model import mrcal_rig_texts, mrcal_text, read_mrcal
from cubicfish_cli.formats.nerfstudio_json import (
    nerfstudio_rig_text,
    nerfstudio_text,
    read_nerfstudio,
)
from cubicfish_cli.formats.nvidia_json import nvidia_rig_text, nvidia_text
from cubicfish_cli.formats.ocamcalib import (
    ocamcalib_text,
    pyocamcalib_text,
    read_ocamcalib,
    read_pyocamcalib,
)
from cubicfish_cli.formats.opencv_cameras import (
    looks_like_opencv,
    opencv_stereo_text,
    opencv_text,
    read_opencv,
)
from cubicfish_cli.formats.ros_yaml import read_ros, ros_rig_texts, ros_text
from cubicfish_cli.model.lens_record import LensRecord

FloatArray = npt.NDArray[np.float64]
Poses = Mapping[str, tuple[FloatArray, FloatArray]]
"""camera_from_world, rotation (3, 3) and translation (3,), by the photo's name."""

# Most programs that read COLMAP's files take OPENCV_FISHEYE: it is the one without a name.
_COLMAP = {
    "colmap" if name == "OPENCV_FISHEYE" else f"colmap-{name.lower().replace('_', '-')}": lens
    for lens, name in COLMAP_MODELS.items()
}

LENS_OF = {
    "opencv": "kannala_brandt",
    "ros": "kannala_brandt",
    **{f"kalibr-{name}": model for name, model in KALIBR_LENSES.items()},
    "ocamcalib": "ocam",
    "pyocamcalib": "ocam",
    **_COLMAP,
    "nerfstudio": "kannala_brandt",
    "gyroflow": "kannala_brandt",
    "nvidia": "ftheta",
    "mrcal": "mrcal_splined",
}
"""Format -> the model of the lens that it holds."""

FILE_NAMES = {
    "opencv": "camera.opencv.yaml",
    "ros": "camera_info.yaml",
    **dict.fromkeys((f"kalibr-{name}" for name in KALIBR_LENSES), "camchain.yaml"),
    "ocamcalib": "calib_results.txt",
    "pyocamcalib": "calibration.json",
    **dict.fromkeys(_COLMAP, "cameras.txt"),
    "nerfstudio": "transforms.json",
    "gyroflow": "lens_profile.json",
    "nvidia": "rig.json",
    "mrcal": "camera.cameramodel",
}
"""Format -> what its file is usually called."""

_RIG_WRITERS: Mapping[str, tuple[str, Callable[[LensRig], str | dict[str, str]]]] = {
    "opencv": ("stereo.opencv.yaml", opencv_stereo_text),
    "ros": ("ros", ros_rig_texts),
    **dict.fromkeys(
        (f"kalibr-{name}" for name in KALIBR_LENSES), ("camchain.yaml", kalibr_rig_text)
    ),
    **dict.fromkeys(_COLMAP, ("rig_config.json", colmap_rig_text)),
    "nerfstudio": ("transforms.json", nerfstudio_rig_text),
    "nvidia": ("rig.json", nvidia_rig_text),
    "mrcal": ("mrcal", mrcal_rig_texts),
}

RIG_FILE_NAMES = {name: usual for name, (usual, _) in _RIG_WRITERS.items()}
"""Format that holds rigs -> what its file is usually called, or the folder of its files."""

FRONT_ONLY = {
    "opencv": "cv2.fisheye",
    "ros": "cv2.fisheye",
    "kalibr-pinhole-equi": "Kalibr's pinhole-equi",
    **dict.fromkeys(_COLMAP, "COLMAP"),
}
"""Format -> what reads it and divides by z first: it sees nothing behind, whatever the lens."""

OWN_FIELD = "the camera is trusted to"
"""What stands in our own files before the half-angle of the field, degrees."""

READABLE = ("opencv", "ros", "kalibr", "ocamcalib", "pyocamcalib", "colmap", "nerfstudio", "mrcal")
_SNIFFED_BYTES = 64_000_000


def foreign_text(name: str, record: LensRecord, note: Sequence[str], poses: Poses) -> str:
    """The text of a file in a format of :data:`LENS_OF`.

    Args:
        name: the format.
        record: a lens of its model.
        note: how the lens was made, a line each; they go in as comments where there are any.
        poses: of the photos, for formats that hold them.

    Raises:
        CameraFileError: the format does not take such values.

    """
    if name == "opencv":
        return opencv_text(record, note)
    if name == "ros":
        return ros_text(record, note)
    if name.startswith("kalibr-"):
        return kalibr_text(record, note)
    if name in _COLMAP:
        return colmap_text(record, note)
    if name == "nerfstudio":
        return nerfstudio_text(record, note, poses)
    if name == "gyroflow":
        return gyroflow_text(record, note)
    if name == "nvidia":
        return nvidia_text(record, note)
    if name == "ocamcalib":  # readers count its lines: comments go nowhere but the end
        return ocamcalib_text(record) + "".join(f"#{line}\n" for line in note)
    if name == "pyocamcalib":
        return pyocamcalib_text(record)
    return mrcal_text(record, note)


def rig_texts(name: str, rig: LensRig, path: Path) -> dict[Path, str]:
    """The files of a rig in a format of :data:`RIG_FILE_NAMES`: path -> text.

    Args:
        name: the format.
        rig: lenses of its model, and where they stand.
        path: of the file, or of the folder of several.

    Raises:
        CameraFileError: the format does not take such a rig, such lenses or such units.

    """
    made = _RIG_WRITERS[name][1](rig)
    if isinstance(made, str):
        return {path: made}
    return {path / own: text for own, text in made.items()}


def read_foreign(
    path: Path,
    *,
    name: str | None = None,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
) -> tuple[LensRecord, str]:
    """Read the lens of another tool's file.

    Args:
        path: the file.
        name: its format, one of :data:`READABLE`; by default it is told by what the file holds.
        camera: which one, of formats that hold several.
        image_size: of the photos, for formats that do not say.

    Returns:
        The lens and the format's name.

    Raises:
        CameraFileError: the file is of no format that is known, or is damaged; one line.

    """
    name = name or sniffed(path)
    record = _read(path, name, camera, image_size)
    if image_size is not None and image_size != record.image_size:
        raise CameraFileError(
            "{} is for photos of {}x{} pixels, not of --size {}x{}: leave out --size".format(
                path, *record.image_size, *image_size
            )
        )
    return record, name


def own_field_deg(path: Path) -> float | None:
    """How far from its axis the lens in a file is trusted, where cubicfish exported it.

    Raises:
        CameraFileError: the file cannot be read.

    """
    data = read_bounded_bytes(path, max_bytes=_SNIFFED_BYTES)
    found = re.search(rb"%s ([0-9.]{1,9}) degrees" % OWN_FIELD.encode(), data)
    degrees = float(found[1]) if found and found[1].count(b".") < 2 else 0.0
    return degrees if 0 < degrees < 180 else None


def _read(
    path: Path, name: str, camera: str | None, image_size: tuple[int, int] | None
) -> LensRecord:
    if name == "kalibr":
        return read_kalibr(path, camera=camera)
    if name == "colmap":
        return read_colmap(path, camera=camera)
    if name == "opencv":
        return read_opencv(path, camera=camera, image_size=image_size)
    if camera is not None:
        raise CameraFileError(f"{path} holds one camera: leave out --camera")
    if name == "pyocamcalib":
        return read_pyocamcalib(path, image_size=image_size)
    readers = {
        "ros": read_ros,
        "ocamcalib": read_ocamcalib,
        "nerfstudio": read_nerfstudio,
        "mrcal": read_mrcal,
    }
    return readers[name](path)


def sniffed(path: Path) -> str:
    """The format of a file, by what it holds.

    Raises:
        CameraFileError: it is of none that is known, or cannot be read.

    """
    if looks_like_cameras_bin(read_bounded_bytes(path, max_bytes=_SNIFFED_BYTES)):
        return "colmap"
    text = read_bounded(path, max_bytes=_SNIFFED_BYTES)
    for name, marks in (
        ("opencv", ("%YAML:1.0",)),
        ("opencv", ("!!opencv-matrix",)),
        ("opencv", ("<opencv_storage",)),
        ("opencv", ('"type_id"', "opencv-matrix")),
        ("mrcal", ("lensmodel", "intrinsics")),
        ("kalibr", ("camera_model:", "intrinsics:", "resolution:")),
        ("ros", ("distortion_model:", "camera_matrix:", "image_width:")),
        ("pyocamcalib", ("taylor_coefficient",)),
        ("nerfstudio", ("fl_x",)),
        ("ocamcalib", ("cam2world",)),
        ("colmap", ("CAMERA_ID",)),
    ):
        if all(mark in text for mark in marks):
            return name
    if looks_like_cameras_txt(text):
        return "colmap"
    if looks_like_opencv(text):
        return "opencv"
    if not text.strip():
        raise CameraFileError(f"{path} is empty: name the file that the other tool wrote")
    if re.search(r"^cubicfish:", text, re.MULTILINE):
        raise CameraFileError(f"{path} is a camera.yaml of cubicfish already: use it as it is")
    raise CameraFileError(
        f"{path} is of no format that is known by its looks: name it with --from, one of "
        + ", ".join(READABLE)
    )
