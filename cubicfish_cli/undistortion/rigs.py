"""Pictures of several cameras on one body: one of all that they see, or two whose rows agree.

Cameras stand at different places, so one picture shows all of them truly only of what is far away,
or at a given distance. Where several see a pixel they are blended by how far it
is from the edge of each one's field, so that no camera begins or ends with a step.

Rectified stereo pairs: a point is in the same row of both pictures.

In the rectified frame x points along the line between the cameras. Half-planes that end in that
line hold what a row shows: flat pictures have such rows up to 180°, and pictures on a cylinder or a
sphere about that line, as the epipolar kinds of :mod:`~cubicfish_cli.undistortion.projections` are,
all around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.angles import unit_rays
from cubicfish_cli.errors import ViewError
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.photos import Picture
from cubicfish_cli.types import FloatArray
from cubicfish_cli.undistortion.fit import seen_field_deg, sees
from cubicfish_cli.undistortion.images import remap_picture
from cubicfish_cli.undistortion.maps import UndistortMap, build_map
from cubicfish_cli.undistortion.projections import (
    EpipolarCylindricalView,
    EpipolarEquirectangularView,
    PerspectiveView,
)
from cubicfish_cli.undistortion.view import (
    Camera,
    CentralView,
    View,
    matrix_of_rotation,
    rotation_vector,
)

Floats = npt.NDArray[np.float32]

# The power of the distance to the edge that a camera counts with: seams are narrower than the
# fields have in common, since near things are seen twice there.
_SHARPNESS = 4
# What the very edge of a field counts with, where it is alone.
_LEAST_WEIGHT = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyCamera:
    """A camera, and how it stands on the body.

    Attributes:
        name: of the camera.
        camera: the camera.
        rotation: (3, 3) of camera_from_rig.
        translation: (3,) of camera_from_rig.

    """

    name: str
    camera: CubicCamera
    rotation: FloatArray
    translation: FloatArray

    @property
    def position(self) -> FloatArray:
        """(3,) where it stands in the body's frame."""
        return np.asarray(-self.rotation.T @ self.translation)

    def view(self, view: View) -> View:
        """A view of the body's frame, of far things, as one of the camera's."""
        if isinstance(view, CentralView):
            turn = self.rotation @ matrix_of_rotation(np.array(view.rotation))
            return replace(view, rotation=rotation_vector(turn))
        raise ViewError(f"a {view.kind} view cannot be made of several cameras")


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """Several cameras on one body, asked as one camera that sees what any of them sees.

    Attributes:
        cameras: the cameras.
        distance: how far from ``centre`` everything is that lies along a ray; None for far away.

    """

    cameras: tuple[BodyCamera, ...]
    distance: float | None = None

    @property
    def centre(self) -> FloatArray:
        """(3,) the middle of the cameras' places: where a picture at a distance is taken from."""
        return np.asarray(np.mean([one.position for one in self.cameras], axis=0))

    @property
    def image_size(self) -> tuple[int, int]:
        """The largest width and height of the photos."""
        sizes = np.array([one.camera.image_size for one in self.cameras])
        width, height = sizes.max(axis=0).tolist()
        return width, height

    @property
    def max_angle_deg(self) -> float:
        """All around: where a field ends is asked ray by ray."""
        return 179.9

    def in_camera(self, one: BodyCamera, rays: FloatArray) -> FloatArray:
        """Rays of the body (..., 3) -> points in a camera's frame, of any length where far."""
        if self.distance is None:
            return rays @ one.rotation.T
        points = unit_rays(rays) * self.distance + self.centre
        return points @ one.rotation.T + one.translation

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Rays (..., 3) -> pixels (..., 2) of that camera whose axis they are nearest to."""
        rays = np.asarray(points, float)
        pixel = np.full((*rays.shape[:-1], 2), np.nan)
        best = np.full(rays.shape[:-1], -np.inf)
        for one in self.cameras:
            own = self.in_camera(one, rays)
            with np.errstate(divide="ignore", invalid="ignore"):
                cosine = own[..., 2] / np.linalg.norm(own, axis=-1)
            better = sees(one.camera, own) & (cosine > best)
            pixel[better] = one.camera.project(own[better], near=self.distance is not None)
            best[better] = cosine[better]
        return pixel

    def map_of(self, one: BodyCamera, view: View) -> UndistortMap:
        """The map that renders a view of the body's frame from a camera's photos."""
        if self.distance is None:
            return replace(build_map(one.camera, one.view(view)), view=view)
        return build_map(_Along(body=self, one=one), view)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Along:
    """A camera of a body, asked for rays of the body."""

    body: Body
    one: BodyCamera

    @property
    def image_size(self) -> tuple[int, int]:
        return self.one.camera.image_size

    def project(self, points: npt.ArrayLike) -> FloatArray:
        points = self.body.in_camera(self.one, np.asarray(points, float))
        return self.one.camera.project(points, near=self.body.distance is not None)


@dataclass(frozen=True, kw_only=True, eq=False)
class Mosaic:
    """What it takes to make one picture of all cameras' photos.

    Attributes:
        view: what it shows, in the body's frame.
        cameras: names of those that see some of it.
        maps: of each.
        weights: of each, (H, W) and above 0 where its map is valid.

    """

    view: View
    cameras: tuple[str, ...]
    maps: tuple[UndistortMap, ...]
    weights: tuple[Floats, ...]

    @property
    def valid(self) -> npt.NDArray[np.bool_]:
        """(H, W) where any camera sees something."""
        return np.asarray(np.any([made.valid for made in self.maps], axis=0))

    @property
    def whole_map(self) -> UndistortMap:
        """For what a map's view and valid pixels tell; it maps nothing."""
        return replace(self.maps[0], valid=self.valid)

    def render(
        self, photos: Mapping[str, Picture], interpolation: str = "linear"
    ) -> tuple[Picture, npt.NDArray[np.bool_]]:
        """One picture of the photos of a shot, and where it shows something (H, W).

        Args:
            photos: by the camera's name, all of one depth and as many channels; a camera without
                one takes no part.
            interpolation: how pixels are blended.

        Raises:
            ViewError: a photo has another size than its camera's, or they differ in nature.

        """
        natures = {(one.dtype, one.shape[2:]) for one in photos.values()}
        if len(natures) > 1:
            raise ViewError(
                "the photos of a shot differ in depth or channels: make all of them grey, or all "
                "colour, of 8 or of 16 bits"
            )
        there = [number for number, name in enumerate(self.cameras) if name in photos]
        if not there:
            raise ViewError("none of the cameras that see this view has a photo in this shot")
        parts = []
        for number in there:
            name = self.cameras[number]
            try:
                parts.append(remap_picture(photos[name], self.maps[number], interpolation))
            except ViewError as problem:
                raise ViewError(f"camera {name}: {problem}") from problem
        wide = (slice(None), slice(None), *(None,) * (parts[0].ndim - 2))
        weight: Floats = np.zeros(self.view.size[::-1], np.float32)
        for number in there:
            weight += self.weights[number]
        shown = np.asarray(weight > 0)
        share = 1 / np.where(shown, weight, np.float32(1))
        mean = np.zeros(parts[0].shape, np.float32)
        for number, part in zip(there, parts, strict=True):
            mean += part * (self.weights[number] * share)[wide]
        if np.issubdtype(parts[0].dtype, np.integer):
            mean = np.rint(mean)
        # Where none sees anything, all parts have the border's colour.
        return np.where(shown[wide], mean, parts[0]).astype(parts[0].dtype), shown


def mosaic_of(body: Body, view: View) -> Mosaic:
    """Prepare to make pictures of a view of the body's frame.

    Raises:
        ViewError: no camera sees anything of it.

    """
    names, maps, weights = [], [], []
    for one in body.cameras:
        made = body.map_of(one, view)
        if not made.valid.any():
            continue
        inside = edge_distance(one.camera)
        share = cv2.remap(inside, made.map_x, made.map_y, cv2.INTER_LINEAR)
        share = np.maximum((share / inside.max()) ** _SHARPNESS, _LEAST_WEIGHT)
        names.append(one.name)
        maps.append(made)
        weights.append(np.where(made.valid, share, np.float32(0)).astype(np.float32))
    if not maps:
        raise ViewError("no camera of the rig sees anything of this view: look elsewhere")
    return Mosaic(view=view, cameras=tuple(names), maps=tuple(maps), weights=tuple(weights))


def edge_distance(camera: CubicCamera) -> Floats:
    """(H, W) how far each pixel of a camera's photo is from the edge of its field, pixels.

    0 outside the field.
    """
    width, height = camera.image_size
    field = np.zeros((height + 2, width + 2), np.uint8)
    outline = np.rint(camera.outline() + 1).astype(np.int32)
    cv2.fillPoly(field, [outline], 255)
    field[[0, -1]] = 0
    field[:, [0, -1]] = 0
    return np.asarray(cv2.distanceTransform(field, cv2.DIST_L2, 5)[1:-1, 1:-1], np.float32)


FORMAT_VERSION = 1

# What is left of a direction across the line between the cameras, for it to say anything.
_LEAST_AHEAD = 0.1
_DEPTHS: Mapping[type[CentralView], tuple[str, str]] = {
    PerspectiveView: (
        "Z = focal * baseline_x / disparity",
        "X = Z * (column - middle[0]) / focal, Y = Z * (row - middle[1]) / focal",
    ),
    EpipolarCylindricalView: (
        "r = focal * baseline_x / disparity",
        "X = r * (column - middle[0]) / focal, Y = r * sin(b), Z = r * cos(b), "
        "b = (row - middle[1]) / focal",
    ),
    EpipolarEquirectangularView: (
        "r = baseline_x / (tan(a) - tan(a - disparity / focal)), a = (column - middle[0]) / focal",
        "X = r * tan(a), Y = r * sin(b), Z = r * cos(b), b = (row - middle[1]) / focal",
    ),
}
"""Kinds of views whose rows agree -> how far a point is from the line between the cameras (or, of
flat ones, how far ahead), and where; in the first camera's rectified frame."""

ROW_ALIGNED = tuple(kind.kind for kind in _DEPTHS)


@dataclass(frozen=True, kw_only=True, eq=False)
class RectifiedPair:
    """Two cameras turned so that x points along the line between them.

    It is asked as a camera that sees what both see of far things; its frame is the rectified one.

    Attributes:
        cameras: the two.
        rotations: rectified_from_camera of each, (3, 3).
        baseline_x: where the second stands on x from the first: negative where it is on the left.

    """

    cameras: tuple[Camera, Camera]
    rotations: tuple[FloatArray, FloatArray]
    baseline_x: float

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
        if type(view) not in _DEPTHS:
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
        depth, point = _DEPTHS[type(view)]
        record: dict[str, Any] = {
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
        if isinstance(view, PerspectiveView):
            first, second = self.projections(view)
            record |= {"P1": first.tolist(), "P2": second.tolist(), "Q": self.Q(view).tolist()}
        return record


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
