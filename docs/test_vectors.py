"""Makes docs/camera-test-vectors.json: two cameras, and where each sees rays and points.

    python docs/test_vectors.py

The first is that of the sample. The second is written below, since few fitted ones have all that a
reader may get wrong: it sees 105 degrees from the axis, is decentred, and its entrance pupil
travels.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish import CubicCamera, FloatArray, load_camera
from cubicfish.models import RadialCamera

HERE = Path(__file__).parent
FILE = HERE / "camera-test-vectors.json"
SAMPLE = HERE.parent / "sample_data" / "true_camera.yaml"
# The rows of P without the factors below, by the monomials in their order.
ROWS = """
#  XXX    YYY    ZZZ    XXY    XXZ    YYX    YYZ    ZZX    ZZY    XYZ    XX     YY     ZZ     XY     YZ     XZ     X      Y      Z     1
   0.02   0.00   0.004  0.00   0.006  0.02   0.00   0.10   0.00  -0.003  0.01   0.00   0.00   0.002  0.00  -0.50   1.20   0.01   0.00  0.00
   0.00   0.02  -0.003  0.02   0.00   0.00   0.004  0.00   0.10   0.005  0.00   0.008  0.00   0.00  -0.50   0.00  -0.01   1.21   0.00  0.00
   0.002  0.001  0.02   0.00   0.00   0.00   0.00   0.00   0.00   0.001  0.01   0.012  0.03   0.00   0.00   0.00   0.015  0.01   0.45  1.00
"""  # noqa: E501
FOCAL, CENTRE, SIZE = 300.0, (642.5, 478.25), (1280, 960)


def wide_camera() -> CubicCamera:
    """The second camera."""
    lines = [line for line in ROWS.splitlines() if line.strip() and not line.startswith("#")]
    first, second, below = np.array([line.split() for line in lines], float)
    P = np.array([FOCAL * first + CENTRE[0] * below, FOCAL * second + CENTRE[1] * below, below])
    return CubicCamera(
        image_size=SIZE,
        P=P / np.linalg.norm(P),
        max_angle_deg=105.0,
        radial=RadialCamera(
            image_size=SIZE, fx=FOCAL, fy=FOCAL, cx=CENTRE[0], cy=CENTRE[1], k=np.zeros(4)
        ),
        pupil_travel=4.0,
        units="mm",
    )


def make() -> dict[str, Any]:
    """The contents of the file."""
    cameras = {"sample": load_camera(SAMPLE).camera, "wide": wide_camera()}
    return {
        "about": "cubicfish camera test vectors: ray and point in the camera's frame, pixel where "
        "it is seen, null outside the field; a ray is a point far away (docs/camera-format.md)",
        "cameras": [_record(name, camera) for name, camera in cameras.items()],
    }


def _record(name: str, camera: CubicCamera) -> dict[str, Any]:
    count = 20
    # Every 51st degree about the axis, and from it to a little beyond the field: one is outside.
    angle = np.linspace(0, np.deg2rad(camera.max_angle_deg + 4), count)
    around = np.deg2rad(51.0) * np.arange(count)
    sine = np.sin(angle)
    rays = np.stack([sine * np.cos(around), sine * np.sin(around), np.cos(angle)], axis=-1)
    rays = rays.round(6)
    points = (rays * np.geomspace(60, 900, count)[:, None]).round(3)
    seen = (rays, camera.project(rays)), (points, camera.project(points, near=True))
    (_, far), (_, near) = seen
    rows = zip(rays.tolist(), _plain(far), points.tolist(), _plain(near), strict=True)
    keys = ("ray", "pixel_of_ray", "point", "pixel_of_point")
    return {
        "name": name,
        "image_size": list(camera.image_size),
        "P": camera.P.tolist(),
        "max_angle_deg": camera.max_angle_deg,
        "pupil": {"travel": camera.pupil_travel, "units": camera.units},
        "seen": [dict(zip(keys, row, strict=True)) for row in rows],
    }


def _plain(pixel: FloatArray) -> list[list[float] | None]:
    return [one.round(9).tolist() if np.isfinite(one).all() else None for one in pixel]


if __name__ == "__main__":
    FILE.write_text(json.dumps(make(), indent=1) + "\n", encoding="utf-8")
