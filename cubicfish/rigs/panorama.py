"""One picture of all that the cameras on one body see.

Cameras stand at different places, so one picture shows all of them truly only of what is far away,
or at a given distance. Where several see a pixel they are blended by how far it
is from the edge of each one's field, so that no camera begins or ends with a step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.errors import ViewError
from cubicfish.files.reading import MAX_COORDINATE
from cubicfish.models.cubic import CubicCamera
from cubicfish.rigs.rig import Rig, RigCamera
from cubicfish.types import FloatArray
from cubicfish.views.choose import build_view
from cubicfish.views.fields import sees
from cubicfish.views.maps import UndistortMap, build_map
from cubicfish.views.options import Interpolation
from cubicfish.views.render import undistort
from cubicfish.views.view import CentralView, View, matrix_of_rotation, rotation_vector

Floats = npt.NDArray[np.float32]

# The power of the distance to the edge that a camera counts with: seams are narrower than the
# fields have in common, since near things are seen twice there.
_SHARPNESS = 4
# What the very edge of a field counts with, where it is alone.
_LEAST_WEIGHT = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """Several cameras on one body, asked as one camera that sees what any of them sees.

    Attributes:
        cameras: the cameras.
        distance: how far from ``centre`` everything is that lies along a ray; None for far away.

    """

    cameras: tuple[RigCamera, ...]
    distance: float | None = None

    def __post_init__(self) -> None:
        if self.distance is not None and not 0 < self.distance <= MAX_COORDINATE:
            raise ViewError(
                f"distance must be above 0 and at most {MAX_COORDINATE:g}, not {self.distance}"
            )

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

    def for_photos(self, sizes: Mapping[str, tuple[int, int]]) -> Body:
        """The same for photos of other sizes, each an exact rescale of its camera's.

        Args:
            sizes: (width, height) by camera; cameras that are not named stay as they are.

        Raises:
            ViewError: one is no rescale.

        """
        cameras = []
        for one in self.cameras:
            try:
                size = sizes.get(one.name, one.camera.image_size)
                cameras.append(replace(one, camera=one.camera.for_photos(size)))
            except ViewError as problem:
                raise problem.amid(f"camera {one.name}: ") from problem
        return replace(self, cameras=tuple(cameras))

    def in_camera(self, one: RigCamera, rays: FloatArray) -> FloatArray:
        """Rays of the body (..., 3) -> points in a camera's frame, of any length where far."""
        if self.distance is None:
            return rays @ one.rotation.T
        length = np.linalg.norm(rays, axis=-1, keepdims=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            points = rays / length * self.distance + self.centre
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

    def map_of(self, one: RigCamera, view: View) -> UndistortMap:
        """The map that renders a view of the body's frame from a camera's photos."""
        if self.distance is not None:
            return build_map(_Along(body=self, one=one), view)
        if not isinstance(view, CentralView):
            raise ViewError(f"a {view.kind} view cannot be made of several cameras")
        turn = one.rotation @ matrix_of_rotation(np.array(view.rotation))
        own = replace(view, rotation=rotation_vector(turn))
        return replace(build_map(one.camera, own), view=view)

    def panorama(self, view: View) -> Panorama:
        """What makes pictures of a view of the body's frame.

        Raises:
            ViewError: no camera sees anything of it.

        """
        names, maps, weights = [], [], []
        for one in self.cameras:
            made = self.map_of(one, view)
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
        return Panorama(view=view, cameras=tuple(names), maps=tuple(maps), weights=tuple(weights))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Along:
    """A camera of a body, asked for rays of the body."""

    body: Body
    one: RigCamera

    @property
    def image_size(self) -> tuple[int, int]:
        return self.one.camera.image_size

    def project(self, points: npt.ArrayLike) -> FloatArray:
        points = self.body.in_camera(self.one, np.asarray(points, float))
        return self.one.camera.project(points, near=self.body.distance is not None)


@dataclass(frozen=True, kw_only=True, eq=False)
class Panorama:
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
    def whole_map(self) -> UndistortMap:
        """For what a map's view and valid pixels tell; it maps nothing."""
        valid = np.any([made.valid for made in self.maps], axis=0)
        return replace(self.maps[0], valid=valid)

    def render(
        self, photos: Mapping[str, npt.NDArray[Any]], interpolation: Interpolation = "linear"
    ) -> tuple[npt.NDArray[Any], npt.NDArray[np.bool_]]:
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
                made = undistort(photos[name], self.maps[number], interpolation=interpolation)
                parts.append(made)
            except ViewError as problem:
                raise problem.amid(f"camera {name}: ") from problem
        wide = (slice(None), slice(None), *(None,) * (parts[0].ndim - 2))
        weights = [self.weights[number] for number in there]
        weight = sum(weights[1:], weights[0])
        shown = np.asarray(weight > 0)
        share = 1 / np.where(shown, weight, np.float32(1))
        mean = np.zeros(parts[0].shape, np.float32)
        for own, part in zip(weights, parts, strict=True):
            mean += part * (own * share)[wide]
        if np.issubdtype(parts[0].dtype, np.integer):
            mean = np.rint(mean)
        # Where none sees anything, all parts have the border's colour.
        return np.where(shown[wide], mean, parts[0]).astype(parts[0].dtype), shown


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


def stitch(
    rig: Rig,
    photos: Mapping[str, npt.NDArray[Any]],
    view: View | None = None,
    *,
    distance: float | None = None,
) -> npt.NDArray[Any]:
    """One picture of a shot, as ``undistort`` renders it.

    Args:
        rig: the rig.
        photos: by the camera's name, (H, W[, C]) of one depth; a camera without one takes no part.
        view: what to show, in the frame of the rig; by default all around, as longitude and
            latitude at the photos' scale.
        distance: how far from the middle of the cameras things are that join, in the rig's unit;
            None for far away.

    Returns:
        (h, w[, C]) of the same depth, black where no camera sees anything.

    Raises:
        CameraFileError: there is no such camera.
        ViewError: a photo has another size than its camera's, photos
            differ in depth or channels, or no camera sees anything of the view.

    """
    for name in photos:
        rig.camera(name)
    body = Body(cameras=rig.cameras, distance=distance)
    chosen = build_view(body, "equirectangular") if view is None else view
    return body.panorama(chosen).render(dict(photos))[0]
