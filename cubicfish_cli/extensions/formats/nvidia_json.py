"""NVIDIA's rig.json (DriveWorks, NCore, Cosmos): f-theta lenses and where they stand, metres.

Frames are FLU: x forward, y to the left, z up; angles are degrees about fixed x, y and z. Pixel
(0, 0) is the middle of the first pixel, as here. The rig's frame is the first camera's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.app.lenses.camera_format import CameraFormat, LensRig, json_text
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.formats.ftheta import FThetaLens

_VERSION = 7
# x right, y down, z forward -> forward, left, up.
_FLU = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def nvidia_text(lens: FThetaLens, note: Sequence[str]) -> str:
    """A lens as a rig.json of one camera."""
    return _text([_sensor("camera", lens, note, np.eye(3), np.zeros(3))])


def nvidia_rig_text(rig: LensRig) -> str:
    """f-theta lenses as a rig.json.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    sensors = []
    for number, one in enumerate(rig.lenses):
        turn, shift = rig.rig_from_lens(number)
        sensors.append(_sensor(one.name, one.lens, one.note, turn, shift * rig.metres))
    return _text(sensors)


def _sensor(
    name: str, lens: FThetaLens, note: Sequence[str], turn: FloatArray, metres: FloatArray
) -> dict[str, Any]:
    angles = Rotation.from_matrix(_FLU @ turn @ _FLU.T).as_euler("xyz", degrees=True)
    coefficients = lens.polynomial.tolist()
    polynomial = " ".join(map(repr, coefficients))
    width, height = lens.image_size
    linear = dict(zip("cde", lens.linear.tolist(), strict=True))
    return {
        "name": f"camera:{name}",
        "protocol": "camera.virtual",
        "parameter": "",
        "nominalSensor2Rig_FLU": {
            "roll-pitch-yaw": angles.tolist(),
            "t": (_FLU @ metres + 0.0).tolist(),
        },
        "properties": {
            "Model": "ftheta",
            "width": str(width),
            "height": str(height),
            "cx": repr(lens.cx),
            "cy": repr(lens.cy),
            "polynomial": polynomial,
            "polynomial-type": "pixeldistance-to-angle",
            "bw-poly": polynomial,
            **{f"linear-{key}": repr(value) for key, value in linear.items()},
        },
        "made_by": list(note),
    }


def _text(sensors: Sequence[dict[str, Any]]) -> str:
    data = {"rig": {"properties": {}, "sensors": list(sensors), "vehicle": {}}, "version": _VERSION}
    return json_text(data)


FORMAT = CameraFormat(
    lenses={"nvidia": FThetaLens},
    file_name="rig.json",
    write=lambda lens, note, poses: nvidia_text(lens, note),
    rig=("rig.json", nvidia_rig_text),
)
