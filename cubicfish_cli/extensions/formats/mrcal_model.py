"""mrcal's ``.cameramodel``: a Python dictionary as text.

``lensmodel``, ``intrinsics`` (fx, fy, cx, cy and what the model has beside them), ``imagersize``
[width, height], ``extrinsics`` (camera from the reference frame: a rotation vector and a shift in
metres, written of rigs and not read) and maybe ``valid_intrinsics_region``, a closed outline in
pixels. Pixel (0, 0) is the middle of the top-left pixel, x to the right, y down and z forward, as
here.

LENSMODEL_SPLINED_STEREOGRAPHIC_order=.._Nx=.._Ny=.._fov_x_deg=.. is written and read, its control
points row by row with Δx and Δy of each together. LENSMODEL_STEREOGRAPHIC is read as a spline of
zeros, LENSMODEL_PINHOLE and LENSMODEL_OPENCV4, 5, 8 and 12 as OpenCV's lens.
"""

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish import CameraFileError, FloatArray, did_you_mean, quoted
from cubicfish.files import parse_plain_yaml, read_text
from cubicfish_cli.extensions.formats.lenses import PinholeLens
from cubicfish_cli.extensions.formats.mrcal_splined import SplinedLens
from cubicfish_cli.foreign.file_contents import Fields, LensRig, PlacedLens, numbers

# optimization_inputs holds all corners of a calibration, packed; it is skipped.
MAX_BYTES = 64_000_000
MAX_PLAIN_BYTES = 4_000_000
MAX_CONTROL_POINTS = 40_000
MAX_REGION = 100_000
# A stereographic lens sees everything but the direction straight behind it.
_STEREOGRAPHIC_FOV_DEG = 350
_SPLINED = re.compile(
    r"LENSMODEL_SPLINED_STEREOGRAPHIC_order=([0-9]{1,2})_Nx=([0-9]{1,4})_Ny=([0-9]{1,4})"
    r"_fov_x_deg=([0-9]{1,3})"
)
_OPENCV_SIZES = {
    "LENSMODEL_PINHOLE": 0,
    "LENSMODEL_OPENCV4": 4,
    "LENSMODEL_OPENCV5": 5,
    "LENSMODEL_OPENCV8": 8,
    "LENSMODEL_OPENCV12": 12,
}
_KNOWN = (*_OPENCV_SIZES, "LENSMODEL_STEREOGRAPHIC", "LENSMODEL_SPLINED_STEREOGRAPHIC_...")
# Comments, packed bytes, text, which may hold any character, and what YAML writes differently.
_TOKEN = re.compile(
    r"#[^\n]*|[bB](?:'[^'\\\n]*'|\"[^\"\\\n]*\")|'[^'\\\n]*'|\"[^\"\\\n]*\"|[()]|\bNone\b"
)


def mrcal_rig_texts(rig: LensRig) -> dict[str, str]:
    """Write splined lenses as a .cameramodel each; the rig's frame is the reference.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    return {f"{one.name}.cameramodel": mrcal_text(one, metres=rig.metres) for one in rig.lenses}


def mrcal_text(one: PlacedLens, *, metres: float = 1.0) -> str:
    """Write a splined lens as the text of a .cameramodel, numbers at full precision.

    Args:
        one: the lens.
        metres: in one unit of its translation.

    """
    lens: SplinedLens = one.lens
    control = lens.control
    model = (
        f"LENSMODEL_SPLINED_STEREOGRAPHIC_order={lens.order}_Nx={control.shape[1]}"
        f"_Ny={control.shape[0]}_fov_x_deg={lens.fov_x_deg}"
    )
    values = [lens.fx, lens.fy, lens.cx, lens.cy, *control.ravel().tolist()]
    rows = [values[at : at + 8] for at in range(0, len(values), 8)]
    lines = [f"    {', '.join(map(repr, row))}," for row in rows]
    outline = [f"    {pixel}," for pixel in lens.region.tolist()]
    turn = Rotation.from_matrix(one.rotation).as_rotvec().tolist()
    extrinsics = [*turn, *(one.translation * metres).tolist()]
    return "\n".join(
        [
            *(f"# {line}" for line in one.note),
            "{",
            f"    'lensmodel':  '{model}',",
            "",
            "    # fx, fy, cx, cy, then the control points row by row, x and y of each",
            "    'intrinsics': [",
            *lines,
            "    ],",
            "",
            *(["    'valid_intrinsics_region': [", *outline, "    ],", ""] if outline else []),
            "    # rt from the reference frame",
            f"    'extrinsics': {extrinsics},",
            "",
            f"    'imagersize': {list(lens.image_size)},",
            "}",
            "",
        ]
    )


def read_mrcal(path: Path) -> SplinedLens | PinholeLens:
    """Read a .cameramodel.

    Raises:
        CameraFileError: the file is not one, or its lens model is not known here; one line that
            names the file and the key.

    """
    data = _parse_dictionary(path, read_text(path, max_bytes=MAX_BYTES, error=CameraFileError))
    for key in ("lensmodel", "imagersize"):
        if key not in data.values:
            raise CameraFileError(f"{path}: it has no key {key}: is it a .cameramodel of mrcal?")
    lens = str(data.values["lensmodel"])
    image_size = data.size_of("imagersize")
    region = _read_region(data)
    if lens in _OPENCV_SIZES:
        values = data.numbers("intrinsics", 4 + _OPENCV_SIZES[lens])
        return PinholeLens(image_size=image_size, **_read_core(path, values), d=values[4:])
    order, nx, ny, fov_x_deg = _read_configuration(path, lens)
    count = 2 * nx * ny if lens != "LENSMODEL_STEREOGRAPHIC" else 0
    values = data.numbers("intrinsics", 4 + count)
    control = values[4:] if count else np.zeros(2 * nx * ny)
    return SplinedLens(
        image_size=image_size,
        **_read_core(path, values),
        order=order,
        fov_x_deg=fov_x_deg,
        control=control.reshape(ny, nx, 2),
        region=region,
    )


def _read_core(path: Path, values: FloatArray) -> dict[str, float]:
    if not (values[:2] > 0).all():
        raise CameraFileError(f"{path}: intrinsics: fx and fy, the first two, must be above 0")
    return dict(zip(("fx", "fy", "cx", "cy"), values.tolist(), strict=False))


def _read_configuration(path: Path, lens: str) -> tuple[int, int, int, int]:
    """Return order, Nx, Ny and fov_x_deg of a splined or a stereographic lens."""
    if lens == "LENSMODEL_STEREOGRAPHIC":
        return 3, 4, 4, _STEREOGRAPHIC_FOV_DEG
    match = _SPLINED.fullmatch(lens)
    if match is None:
        raise CameraFileError(
            f"{path}: lensmodel {quoted(lens)} cannot be read here: {did_you_mean(lens, _KNOWN)}"
        )
    order, nx, ny, fov_x_deg = map(int, match.groups())
    if (
        order not in (2, 3)
        or min(nx, ny) <= order
        or nx * ny > MAX_CONTROL_POINTS
        or not 0 < fov_x_deg < 360
    ):
        raise CameraFileError(
            f"{path}: lensmodel {quoted(lens)}: order must be 2 or 3, Nx and Ny above it and "
            f"together at most {MAX_CONTROL_POINTS} points, fov_x_deg between 0 and 360"
        )
    return order, nx, ny, fov_x_deg


def _read_region(data: Fields) -> FloatArray:
    rows, key = data.values.get("valid_intrinsics_region"), "valid_intrinsics_region"
    if rows is None:
        return np.zeros((0, 2))
    if not isinstance(rows, list) or len(rows) > MAX_REGION:
        raise CameraFileError(f"{data.path}: {key} must be a list of pixels")
    if not rows:
        raise CameraFileError(
            f"{data.path}: {key} is empty: by this file the lens is valid nowhere"
        )
    region = np.array([numbers(data.path, row, key, (2,)) for row in rows])
    if len(region) < 4:  # as mrcal does with an outline that is none
        return np.zeros((0, 2))
    closed = np.abs(region[0] - region[-1]).max() < 1e-6
    return region if closed else np.concatenate([region, region[:1]])


def _parse_dictionary(path: Path, text: str) -> Fields:
    """Parse the dictionary, without the packed bytes in it.

    Without comments, packed bytes and tuples it is YAML in braces, whose reader evaluates nothing
    and has bounds.
    """
    plain = _TOKEN.sub(_convert_token, text)
    if len(plain) > MAX_PLAIN_BYTES:
        raise CameraFileError(f"{path}: too much in it for a lens: is it the right file?")
    data = parse_plain_yaml(path, plain, error=CameraFileError)
    return Fields.of(path, data, "a .cameramodel")


def _convert_token(match: re.Match[str]) -> str:
    token = match[0]
    if token in "()":
        return "[" if token == "(" else "]"
    return {"#": "", "b": "null", "B": "null", "N": "null"}.get(token[0], token)
