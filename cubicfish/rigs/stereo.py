"""Rectified stereo pairs: a point is in the same row of both pictures.

In the rectified frame x points along the line between the cameras. Half-planes that end in that
line hold what a row shows: flat pictures have such rows up to 180°, and pictures on a cylinder or a
sphere about that line, as the epipolar kinds of :mod:`~cubicfish.views.view` are,
all around it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.errors import ViewError
from cubicfish.files.plain_yaml import plain_yaml_text
from cubicfish.rigs.rig import Rig
from cubicfish.types import FloatArray
from cubicfish.views.fields import seen_field_deg, sees
from cubicfish.views.view import Camera, CentralView, rotation_vector

FORMAT_VERSION = 1

# What is left of a direction across the line between the cameras, for it to say anything.
_LEAST_AHEAD = 0.1
_DEPTHS: Mapping[str, tuple[str, str]] = {
    "perspective": (
        "Z = focal * baseline_x / disparity",
        "X = Z * (column - middle[0]) / focal, Y = Z * (row - middle[1]) / focal",
    ),
    "epipolar-cylindrical": (
        "r = focal * baseline_x / disparity",
        "X = r * (column - middle[0]) / focal, Y = r * sin(b), Z = r * cos(b), "
        "b = (row - middle[1]) / focal",
    ),
    "epipolar-equirectangular": (
        "r = baseline_x / (tan(a) - tan(a - disparity / focal)), a = (column - middle[0]) / focal",
        "X = r * tan(a), Y = r * sin(b), Z = r * cos(b), b = (row - middle[1]) / focal",
    ),
}
"""Kinds of views whose rows agree -> how far a point is from the line between the cameras (or, of
flat ones, how far ahead), and where; in the first camera's rectified frame."""

ROW_ALIGNED = tuple(_DEPTHS)


@dataclass(frozen=True, kw_only=True, eq=False)
class RectifiedPair:
    """Two cameras turned so that x points along the line between them.

    It is asked as a camera that sees what both see of far things; its frame is the rectified one.

    Attributes:
        cameras: the two.
        rotations: rectified_from_camera of each, (3, 3).
        baseline_x: where the second stands on x from the first: negative where it is on the left.
        names: of the two, in their rig.
        units: of the baseline; None where they are not known.

    """

    cameras: tuple[Camera, Camera]
    rotations: tuple[FloatArray, FloatArray]
    baseline_x: float
    names: tuple[str, ...] = ()
    units: str | None = None

    @property
    def max_angle_deg(self) -> float:
        """All around: where either ends is asked ray by ray."""
        return 179.0

    @property
    def image_size(self) -> tuple[int, int]:
        """That of the first camera's photos."""
        return self.cameras[0].image_size

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Rays in the rectified frame (..., 3) -> pixels of the first's photo (..., 2).

        NaN where not both photos show them.
        """
        rays = np.asarray(points, float)
        first, second = self.cameras
        pixel = first.project(rays @ self.rotations[0])
        both = sees(first, rays @ self.rotations[0]) & sees(second, rays @ self.rotations[1])
        return np.where(both[..., None], pixel, np.nan)

    def field_view(self, view: CentralView) -> CentralView:
        """A view with as many rows as the middle column shows of what both see.

        Near the line between the cameras, where there is no depth, all rows show something.
        """
        down = np.radians(seen_field_deg(self, view)[1])
        return replace(view, size=(view.size[0], max(2, 2 * round(view.focal * down / 2))))

    def views(self, view: CentralView) -> tuple[CentralView, CentralView]:
        """A view from the rectified frame as that of either camera.

        Raises:
            ViewError: it has other rows for the two.

        """
        if view.kind not in _DEPTHS:
            raise ViewError(
                f"rows of {view.kind} views do not agree: choose " + ", ".join(ROW_ALIGNED)
            )
        first, second = (
            replace(view, rotation=rotation_vector(turn.T @ view.camera_from_view))
            for turn in self.rotations
        )
        return first, second

    def projections(self, view: CentralView) -> tuple[FloatArray, FloatArray]:
        """P1 and P2 (3, 4) of flat pictures, pixels, as cv2.stereoRectify has them."""
        first = np.column_stack([view.camera_matrix, np.zeros(3)])
        second = first.copy()
        second[0, 3] = -view.focal * self.baseline_x
        return first, second

    def Q(self, view: CentralView) -> FloatArray:
        """(4, 4) takes (column, row, disparity, 1), pixels of flat pictures, to a point (4,)."""
        x, y = view.middle
        return np.array(
            [
                [1, 0, 0, -x],
                [0, 1, 0, -y],
                [0, 0, 0, view.focal],
                [0, 0, 1 / self.baseline_x, 0],
            ]
        )

    def points(self, view: CentralView, pixel: FloatArray, disparity: FloatArray) -> FloatArray:
        """What both pictures show, in the first camera's rectified frame.

        Args:
            view: whose pictures they are, in the rectified frame.
            pixel: (..., 2) of the first picture.
            disparity: (...,) column there less that in the second picture.

        Returns:
            (..., 3) points in the unit of the baseline; behind, or of no end, where the disparity
            has the wrong sign or is 0.

        """
        other = pixel - np.stack([disparity, np.zeros_like(disparity)], axis=-1)
        along = []
        for one in (pixel, other):
            rays = view.rays(one)
            along.append(rays / np.hypot(rays[..., 1], rays[..., 2])[..., None])
        with np.errstate(divide="ignore"):
            distance = self.baseline_x / (along[0][..., 0] - along[1][..., 0])
        return np.asarray(along[0] * distance[..., None])

    def as_record(self, view: CentralView) -> dict[str, Any]:
        """What it takes to get from disparities to points, plain data."""
        x, y = view.middle
        depth, point = _DEPTHS[view.kind]
        record: dict[str, Any] = {
            "cameras": list(self.names),
            "units": self.units,
            "photo_sizes": [list(camera.image_size) for camera in self.cameras],
            "cubicfish_stereo": FORMAT_VERSION,
            "kind": view.kind,
            "image_size": list(view.size),
            "focal": view.focal,
            "middle": [x, y],
            "baseline": abs(self.baseline_x),
            "baseline_x": self.baseline_x,
            "disparity": "column in the first picture - column in the second",
            "depth": depth,
            "point": point,
            "pixels_per_degree": view.focal * np.pi / 180,
            "view_from_camera": [
                (view.camera_from_view.T @ turn).tolist() for turn in self.rotations
            ],
        }
        if view.kind == "perspective":
            first, second = self.projections(view)
            record |= {"P1": first.tolist(), "P2": second.tolist(), "Q": self.Q(view).tolist()}
        return record

    def text(self, view: CentralView) -> str:
        """The same as YAML."""
        return plain_yaml_text(self.as_record(view))


def rectified_pair(
    first: Camera, second: Camera, rotation: FloatArray, translation: FloatArray
) -> RectifiedPair:
    """Two cameras turned so that x points along the line between them, and z where both look.

    Args:
        first: a camera.
        second: another.
        rotation: (3, 3) of second_from_first.
        translation: (3,) of second_from_first, in any unit.

    Raises:
        ViewError: they stand at one place.

    """
    between = -rotation.T @ translation
    length = float(np.linalg.norm(between))
    if not length > 0:
        raise ViewError("the two cameras stand at one place: there is no depth to be seen")
    x = between / length
    right, _, ahead = (np.eye(3) + rotation) / 2  # the mean of both cameras', in the first's frame
    if right @ x < 0:
        x, length = -x, -length
    own_ahead, up = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    for wish in (ahead, own_ahead, up):  # cameras back to back, or one behind the other
        z = wish - (wish @ x) * x
        if np.linalg.norm(z) > _LEAST_AHEAD:
            break
    z /= np.linalg.norm(z)
    turn = np.stack([x, np.cross(z, x), z])
    return RectifiedPair(
        cameras=(first, second), rotations=(turn, turn @ rotation.T), baseline_x=length
    )


def rectify(rig: Rig, first: str, second: str) -> RectifiedPair:
    """Two cameras of a rig, turned so that their pictures have common rows.

    It is a camera that sees what both see: :func:`build_view` takes it, for flat views and the
    epipolar kinds, ``views`` gives either camera's own view for :func:`build_map`, and ``points``
    what disparities are worth.

    Args:
        rig: the rig.
        first: name of a camera.
        second: name of another.

    Raises:
        CameraFileError: there is no such camera.
        ViewError: the two stand at one place.

    """
    one, other = (rig.camera(name) for name in (first, second))
    pair = rectified_pair(one.camera, other.camera, *other.beside(one))
    return replace(pair, names=(first, second), units=rig.units)
