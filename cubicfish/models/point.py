"""The ``point`` lift: Φ of the 3D point itself, as Zhu & Yin (2010) write Eq. 4–7 in Section 3.

λ m = P Φ((X − offset) / scale). X is a world point (one photo) or a camera-frame point (several).
Unlike the ``ray`` lift this is no camera with a centre: depth matters, and P means something only
in the volume that the corners filled. Where all corners lay on a few planes, every cubic that
vanishes on these planes may be added to a row of P without changing any corner's pixel: then P
says nothing of points off the planes.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from cubicfish.errors import FitError
from cubicfish.models.lift import SIZE, lift
from cubicfish.types import BoolArray, FloatArray
from cubicfish.wording import Brief

Frame = Literal["world", "camera"]

# In units of the target's size: what a cubic that vanishes on all corners may come to at a point
# that still counts as lying where they were.
_ON_BOARD = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PointCamera(Brief):
    """A ratio of cubics in the point.

    Attributes:
        image_size: (width, height), pixels.
        P: (3, 20), columns in the paper's order.
        frame: which frame the points are in.
        offset: (3,) and ``scale``: Φ is applied to (X − offset) / scale.
        null: (K, 20) orthonormal cubics that vanish on every corner of the fit; K = 0 when the
            corners determined all of P.
        extent: the corners lay within this distance of ``offset``, in units of ``scale``.
        valid: (M, 2) outline of the corners, pixels.

    """

    image_size: tuple[int, int]
    P: FloatArray
    frame: Frame
    offset: FloatArray
    scale: float
    null: FloatArray
    extent: float
    valid: FloatArray

    @property
    def rank(self) -> int:
        """Rank of Φ over the corners of the fit: 20 when P is determined in the whole volume."""
        return SIZE - len(self.null)

    def outline(self) -> FloatArray:
        """(M, 2) where it may be trusted in the photo, pixels: :attr:`valid`."""
        return self.valid

    def project(self, points: npt.ArrayLike, *, near: bool = True) -> FloatArray:
        """Points (..., 3) in :attr:`frame` -> pixels (..., 2); all of them count as near.

        NaN outside the volume of the corners, at a pole, and off the boards where the rank is
        below 20; :meth:`refuse_off_boards` raises an error for the latter.
        """
        local = self._normalise(points)
        values = lift(np.where(np.isfinite(local), local, 0))
        homogeneous = values @ self.P.T
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel = homogeneous[..., :2] / homogeneous[..., 2:]
            inside = np.linalg.norm(local, axis=-1) <= self.extent
        inside &= (homogeneous[..., 2] > 0) & self._are_on_boards(values)
        return np.where(inside[..., None], pixel, np.nan)

    def refuse_off_boards(self, points: npt.ArrayLike) -> None:
        """Refuse points (..., 3) about which the corners said nothing.

        Raises:
            FitError: a finite point is off the boards and the rank is below 20.

        """
        given = np.asarray(points, float).reshape(-1, 3)
        given = given[np.isfinite(given).all(axis=1)]
        off = np.flatnonzero(~self._are_on_boards(lift(self._normalise(given))))
        if off.size:
            x, y, z = given[off[0]].tolist()
            raise FitError(
                f"point {x:g}, {y:g}, {z:g} is off the boards: the corners gave P rank "
                f"{self.rank} of {SIZE}, so any cubic that is zero on the boards could be added "
                "to it, and a pixel there would be made up; use lift 'ray', or boards on four or "
                "more planes in general position"
            )

    def _normalise(self, points: npt.ArrayLike) -> FloatArray:
        return (np.asarray(points, float) - self.offset) / self.scale

    def _are_on_boards(self, values: FloatArray) -> BoolArray:
        return np.abs(values @ self.null.T).max(axis=-1, initial=0) <= _ON_BOARD
