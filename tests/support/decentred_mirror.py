"""A pinhole camera that looks up into a curved mirror which is not centred on it, ray by ray.

Each ray is traced: from the pinhole to the mirror, whose axis is shifted and tilted, and on from
where it is met. So the camera has no axis of symmetry and no centre of projection, and it is a
member of no family that is fitted. Lengths are millimetres, like the target's::

    lens = DecentredMirror(shift_mm=(0.6, -0.3), tilt_deg=(0.8, 0.5))
    pixel = lens.project(points)  # (N, 3) in the camera frame -> (N, 2)

The camera frame is that of the mirror's inner focus, z down, back at the pinhole. What a mirror
shows is mirrored; here the picture is mirrored back, as these cameras' files mostly are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish import FloatArray
from cubicfish.scene.truth import rotation_matrix

_ROUNDS = 12
_STEP = 1e-6  # of a difference that stands for a derivative, of the pinhole's slope
_MET = 1e-9  # radians between a ray and the point that it is to meet
# The camera frame from the pinhole's: the picture is mirrored back.
_TURNED = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True, kw_only=True)
class DecentredMirror:
    """A hyperbolic mirror above a pinhole.

    Attributes:
        image_size: (width, height) in pixels.
        focal: of the pinhole, pixels.
        a_mm, c_mm: half of the hyperboloid's axis, and of its foci's distance.
        shift_mm: by how much the mirror's lower focus is beside the pinhole.
        tilt_deg: of the mirror about x and about y, through that focus.
        rim_deg: the largest angle from the pinhole's axis that the mirror fills.
        hub_deg: up to here the camera sees itself.

    """

    image_size: tuple[int, int] = (960, 720)
    focal: float = 500.0
    a_mm: float = 15.0
    c_mm: float = 25.0
    shift_mm: tuple[float, float] = (0.0, 0.0)
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    rim_deg: float = 35.0
    hub_deg: float = 6.0

    def project(self, points: FloatArray) -> FloatArray:
        """Points in the camera frame (..., 3) -> pixels (..., 2), NaN where the mirror shows none.

        The slope at the pinhole whose ray meets the point is found by Newton's method.
        """
        shape = np.shape(points)[:-1]
        target = np.reshape(points, (-1, 3)) * _TURNED + self._focus
        # A mirror that is centred would reflect it at about half of its angle.
        away = target - self._focus
        angle = np.arctan2(np.hypot(away[:, 0], away[:, 1]), -away[:, 2])
        outwards = away[:, :2] / np.hypot(away[:, 0], away[:, 1])[:, None]
        slope = outwards * np.tan(angle / 6)[:, None]
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                miss = self._miss(slope, target)
                by_x, by_y = (
                    (self._miss(slope + step, target) - miss) / _STEP for step in _STEP * np.eye(2)
                )
                square = np.stack([by_x, by_y], axis=-1)
                right = np.einsum("nji,nj->ni", square, miss)
                gram = np.einsum("nji,njk->nik", square, square)
                bad = ~np.isfinite(gram).all(axis=(1, 2)) | ~(np.linalg.det(gram) > 0)
                gram[bad], right[bad] = np.eye(2), 0.0
                slope = slope - np.linalg.solve(gram, right[..., None])[..., 0]
            met = np.linalg.norm(self._miss(slope, target), axis=1) < _MET
            inner = np.degrees(np.arctan(np.hypot(*slope.T)))
            seen = met & (inner >= self.hub_deg) & (inner <= self.rim_deg)
        pixel = slope * self.focal + (np.array(self.image_size) - 1) / 2
        return np.where(seen[:, None], pixel, np.nan).reshape(*shape, 2)

    def rays(self, pixel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) -> where their rays leave the mirror, and their unit directions (N, 3)."""
        start, way = self._trace((pixel - (np.array(self.image_size) - 1) / 2) / self.focal)
        return (start - self._focus) * _TURNED, way * _TURNED

    @property
    def _focus(self) -> FloatArray:
        """The mirror's inner focus in the pinhole's frame, if it were centred."""
        return np.array([0.0, 0.0, 2 * self.c_mm])

    def _miss(self, slope: FloatArray, target: FloatArray) -> FloatArray:
        """Sine of the angle (N, 3) by which the ray of a slope (N, 2) passes a point (N, 3)."""
        start, way = self._trace(slope)
        towards = target - start
        return np.asarray(np.cross(way, towards) / np.linalg.norm(towards, axis=1)[:, None])

    def _trace(self, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where the rays of slopes (N, 2) are reflected, and where they go: (N, 3) each."""
        turn = rotation_matrix(np.radians([*self.tilt_deg, 0.0]))
        way = np.column_stack([slope, np.ones(len(slope))])
        way /= np.linalg.norm(way, axis=1)[:, None]
        # In the mirror's frame, whose origin is midway between its foci and whose axis is z.
        ray = way @ turn
        begin = -np.array([*self.shift_mm, 0.0]) @ turn - np.array([0.0, 0.0, self.c_mm])
        # z²/a² − (x² + y²)/b² = 1.
        form = np.array([-1.0, -1.0, 0.0]) / (self.c_mm**2 - self.a_mm**2)
        form[2] = 1 / self.a_mm**2
        square, half = (ray * ray) @ form, ray @ (begin * form)
        rest = begin @ (begin * form) - 1
        # Of the two crossings the farther one is the upper sheet.
        along = (-half + np.sqrt(half**2 - square * rest)) / square
        met = begin + along[:, None] * ray
        normal = met * form
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        out = ray - 2 * np.sum(ray * normal, axis=1)[:, None] * normal
        start = (met + np.array([0.0, 0.0, self.c_mm])) @ turn.T + [*self.shift_mm, 0.0]
        return start, out @ turn.T
