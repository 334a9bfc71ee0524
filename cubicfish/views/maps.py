"""View and camera -> the map that ``cv2.remap`` takes."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.angles import angle_from_axis, azimuth, unit_rays
from cubicfish.errors import ViewError
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import ray_at
from cubicfish.types import BoolArray, FloatArray
from cubicfish.views.cubic_grid import grid_of
from cubicfish.views.options import Interpolation
from cubicfish.views.view import MAX_SIDE, PlaneView, PointProjector, View
from cubicfish.wording import Brief, did_you_mean, quoted

OUTSIDE = -1.0
_CV2_FLAGS = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "lanczos": cv2.INTER_LANCZOS4,
}
# A block's arrays stay in the processor's cache; fewer pixels than these are not worth a thread.
_PIXELS_PER_BLOCK = 65_536
_PIXELS_FOR_THREADS = 250_000
_THREADS = 2
_EDGE_SAMPLES = 200  # samples along a side of the photo


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class UndistortMap(Brief):
    """Where each pixel of a view comes from in the photo.

    ``cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR)`` renders the view.

    Attributes:
        map_x, map_y: (H, W) float32 pixels of the photo; −1, which ``cv2.remap`` renders black,
            where the photo has none.
        valid: (H, W) whether the photo has the pixel and the camera may be trusted there.
        view: what is rendered.
        image_size: (width, height) of the photos that the map is for.
        redistorts: whether the map is the inverse: it makes the camera's photo from a picture of
            the view.

    """

    map_x: npt.NDArray[np.float32]
    map_y: npt.NDArray[np.float32]
    valid: BoolArray
    view: View
    image_size: tuple[int, int]
    redistorts: bool = False

    @property
    def empty(self) -> BoolArray:
        """(H, W) where the photo has nothing."""
        return np.asarray(self.map_x == OUTSIDE)

    def render(
        self, photo: npt.NDArray[Any], interpolation: Interpolation = "linear", empty: float = 0
    ) -> npt.NDArray[Any]:
        """The view, (H, W) or (H, W, C), of a photo's depth.

        It is black where the map has nothing, as ``cv2.remap`` renders the map's file; a fourth
        channel is 0 there.

        Args:
            photo: of the size that the map is for, (h, w) or (h, w, C).
            interpolation: how pixels are interpolated.
            empty: the value of what the photo does not have.

        Raises:
            ViewError: the photo has another size, or the interpolation is not known.

        """
        if interpolation not in _CV2_FLAGS:
            raise ViewError(
                f"interpolation {quoted(interpolation)} is not known: "
                f"{did_you_mean(str(interpolation), _CV2_FLAGS)}"
            )
        height, width = photo.shape[:2]
        if (width, height) != self.image_size:
            raise ViewError(
                f"the photo has {width}x{height} pixels, the map is for "
                f"{self.image_size[0]}x{self.image_size[1]}: "
                "use photos of that size, neither scaled nor cropped nor turned"
            )
        # Wider kernels reach over the photo's edge: mirror the photo there, rather than blend it.
        wide = interpolation in ("cubic", "lanczos")
        border = cv2.BORDER_REFLECT_101 if wide else cv2.BORDER_CONSTANT
        flags, black = _CV2_FLAGS[interpolation], (empty,) * 4
        out = np.asarray(cv2.remap(photo, self.map_x, self.map_y, flags, None, border, black))
        if wide:
            out[self.empty] = empty
        return out


def build_map(camera: PointProjector, view: View, rows: range | None = None) -> UndistortMap:
    """The map (H, W), pixels of the camera's photos, that renders ``view`` from them.

    Rows are done in blocks, on two threads when there are many, so the memory needed beyond
    the map is bounded.

    Args:
        camera: whose photos they are.
        view: what is rendered.
        rows: the rows of the view that the map is of; all by default.

    Raises:
        ViewError: the camera's photos are larger than ``cv2.remap`` can take.

    """
    photo_width, photo_height = camera.image_size
    if max(camera.image_size) > MAX_SIDE:
        raise ViewError(
            f"photos of {photo_width}x{photo_height} cannot be undistorted: "
            f"a side may have {MAX_SIDE} pixels at most"
        )
    width, height = view.size
    rows = rows or range(height)
    map_x, map_y = np.empty((2, len(rows), width), np.float32)
    valid = np.empty((len(rows), width), bool)
    grid = grid_of(camera, view) if isinstance(camera, CubicCamera) else None
    project = seen_near(camera) if isinstance(view, PlaneView) else camera.project
    step = max(1, _PIXELS_PER_BLOCK // width)

    def fill(top: int) -> None:
        block = slice(top, min(rows.stop, top + step))
        own = slice(block.start - rows.start, block.stop - rows.start)
        x, y = map_x[own], map_y[own]
        if grid is not None:
            grid.fill(block, x, y)
        else:
            pixel = np.stack(np.meshgrid(np.arange(width), np.r_[block]), axis=-1)
            x[...], y[...] = np.moveaxis(project(view.rays(pixel)), -1, 0)
        # Comparisons with NaN are false. Beyond the outer pixels' centres cv2.remap would
        # blend with the black around the photo.
        if (
            x.min() >= 0 and x.max() <= photo_width - 1 and y.min() >= 0
        ) and y.max() <= photo_height - 1:
            valid[own] = True
            return
        inside = (x >= 0) & (x <= photo_width - 1) & (y >= 0) & (y <= photo_height - 1)
        valid[own] = inside
        np.logical_not(inside, out=inside)
        np.copyto(x, OUTSIDE, where=inside)
        np.copyto(y, OUTSIDE, where=inside)

    with ThreadPoolExecutor(_THREADS if valid.size >= _PIXELS_FOR_THREADS else 1) as threads:
        list(threads.map(fill, rows[::step]))
    made = UndistortMap(
        map_x=map_x, map_y=map_y, valid=valid, view=view, image_size=camera.image_size
    )
    if isinstance(camera, WholePhoto):
        own = build_map(camera.camera, view, rows)
        np.copyto(map_x, own.map_x, where=own.valid)
        np.copyto(map_y, own.map_y, where=own.valid)
        return replace(made, valid=own.valid)
    return made


def seen_near(camera: PointProjector) -> Callable[[FloatArray], FloatArray]:
    """A camera's projection of points whose distance counts."""
    return partial(camera.project, near=True) if isinstance(camera, CubicCamera) else camera.project


@dataclass(frozen=True, kw_only=True)
class WholePhoto:
    """A camera that shows all of its photos, also where it is not calibrated.

    Beyond the cone where P may be trusted it continues as its radial reference does, outwards from
    where P sees the cone's edge.

    Attributes:
        camera: the camera.

    """

    camera: CubicCamera

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) of the photos, pixels."""
        return self.camera.image_size

    @cached_property
    def max_angle_deg(self) -> float:
        """Half-angle of the cone that holds what photos show, up to 90° where it is not known."""
        share = np.linspace(0, 1, _EDGE_SAMPLES)
        low, high = np.zeros(_EDGE_SAMPLES), np.ones(_EDGE_SAMPLES)
        sides = [(share, low), (share, high), (low, share), (high, share)]
        edge = np.concatenate([np.stack(side, axis=-1) for side in sides])
        angle = angle_from_axis(self.camera.photo_rays(edge * (np.array(self.image_size) - 1)))
        return max(self.camera.max_angle_deg, float(np.nan_to_num(np.rad2deg(angle), nan=90).max()))

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        """Camera-frame rays (..., 3) -> pixels (..., 2), NaN beyond :attr:`max_angle_deg`."""
        rays, radial = unit_rays(points), self.camera.radial
        cone = np.full(rays.shape[:-1], np.deg2rad(self.camera.max_angle_deg))
        rim = ray_at(cone, azimuth(rays[..., :2]))
        beyond = radial.project(rays) + self.camera.project(rim) - radial.project(rim)
        with np.errstate(invalid="ignore"):
            beyond[angle_from_axis(rays) > np.deg2rad(self.max_angle_deg)] = np.nan
        own = self.camera.project(rays)
        return np.where(np.isfinite(own), own, beyond)
