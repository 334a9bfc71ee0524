"""A camera as two grids, for networks and renderers: pixels of rays, and rays of pixels.

The .npz holds control points of uniform cubic B-splines, float32:

- ``pixels`` (N, N, 2): the pixel of a ray, over the plane u = 2 (x, y) / (|X| + z) of its direction
  (x, y, z), whose length is 2 tan(θ/2);
- ``rays`` (M, N, 2): u of the ray that a pixel sees, over the photo;
- ``pixels_at`` and ``rays_at`` (3,): x and y of the first control point, and the step from each to
  the next;
- ``largest_px``, how far ``pixels`` may be off; ``image_size``; ``max_angle_deg``;
- ``pupil_travel`` and its ``units``: near points are seen from the moving entrance pupil.

The second is rough where a lens's picture hardly grows any more: a reader takes its difference
between the pixel and the first grid's pixel of what was found, as docs/formats.md does for numpy,
torch and C.
"""

import io
import math

import numpy as np

from cubicfish import Calibration, CameraFile, CubicCamera, FloatArray
from cubicfish.models import cone_rays
from cubicfish_cli.extensions.formats.mrcal_splined import fit_surfaces, stereographic

# Control points across: more are tried until pixels are this near to the camera's.
_SIZES = (33, 49, 65)
_NEAR_PX = 0.001
_RAYS = 16_000
# The surfaces go on a little beyond the field and the photo, since splines are least certain at
# their edge.
_BEYOND_RAD, _MARGIN = 0.005, 1.02
_ORDER = 3


def rays_content(known: Calibration | CameraFile, to: str, name: str | None) -> bytes:
    """Return what the .npz of a camera holds; the name says nothing here."""
    camera = known.camera
    rays = cone_rays(math.radians(camera.max_angle_deg) + _BEYOND_RAD, _RAYS)
    pixel, _ = camera.pixel_and_slopes(rays, near=False)
    pixels, pixels_at, largest_px = _fit_pixels(rays, pixel)
    planes, rays_at = _fit_rays(camera, rays, pixel)
    content = io.BytesIO()
    np.savez(
        content,
        format="cubicfish rays 1",
        image_size=np.array(camera.image_size),
        max_angle_deg=camera.max_angle_deg,
        pupil_travel=camera.pupil_travel,
        units=camera.units or "",
        pixels=pixels,
        pixels_at=pixels_at,
        largest_px=largest_px,
        rays=planes,
        rays_at=rays_at,
    )
    return content.getvalue()


def _fit_pixels(rays: FloatArray, pixel: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Fit pixels (N, N, 2) over u; also return where they are (3,), and the largest error."""
    u = stereographic(rays)
    half = np.full(2, np.abs(u).max() * (1 + 1e-6))
    for count in _SIZES:
        found, at, again = _fit(u, half, pixel, count)
        largest = float(np.abs(again - pixel).max())
        if largest <= _NEAR_PX:
            break
    return found, at, largest


def _fit_rays(
    camera: CubicCamera, rays: FloatArray, pixel: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fit u (M, N, 2) over the photo; also return where they are (3,)."""
    size = np.array(camera.image_size)
    middle, half = (size - 1) / 2, _MARGIN * size / 2
    inside = (np.abs(pixel - middle) <= half).all(axis=1)
    offset = pixel[inside] - middle
    found, at, _ = _fit(offset, half, stereographic(rays[inside]), _SIZES[0])
    return found, at + np.array([*middle, 0.0])


def _fit(
    places: FloatArray, half: FloatArray, values: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a surface to values (N, 2) at places (N, 2), at most ``half`` (2,) from the middle.

    Returns:
        Control points, ``count`` from left to right; where they are (3,); the surface's values.

    """
    cells = count - _ORDER
    rows = math.ceil(cells * half[1] / half[0] * (1 - 1e-9)) + _ORDER
    # The splines of mrcal's model are over a plane in which a half-angle of 90° is 2 away.
    found, rest = fit_surfaces(2 * places / half[0], values, count, rows, fov_x_deg=180)
    step = 2 * half[0] / cells
    first = -step * (np.array([count, rows]) - 1) / 2
    return found.astype(np.float32), np.array([*first, step]), values - rest
