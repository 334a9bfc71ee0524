"""A cubic camera as the nearest lens of another model, and how near that is.

Other models have one centre of projection, while a fisheye's entrance pupil travels: they can stand
for it at one distance only. Of things much nearer or farther they are wrong by what the pupil's
travel moves these in the picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from cubicfish.angles import angle_from_axis, unit_rays
from cubicfish.errors import FitError
from cubicfish.geometry import pixel_grid
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.lens import Lens
from cubicfish.solve.fit_lens import FreeLens, nearest_lens
from cubicfish.solve.poses import cross_matrix
from cubicfish.solve.statistics import rings, rms_px
from cubicfish.types import FloatArray

L = TypeVar("L", bound=Lens)

_FIT_PIXELS = 6_000
_ERROR_PIXELS = 40_000
_FEWEST = 100
# Where boards were held at a median distance, about half of their corners are within these.
_SPREAD = (0.8, 1.0, 1.25)


@dataclass(frozen=True, kw_only=True, eq=False)
class ConversionError:
    """How far a lens is from the camera that it stands for, as far as the camera is known.

    Attributes:
        rms_px: root mean square of the distance, sqrt(mean(dx² + dy²)).
        max_px: the largest distance; infinite where the lens does not see a ray that the camera
            sees.
        max_angle_deg: the angle from the axis up to which both figures hold.
        by_angle: in rings of 10° up to there: ``from_deg``, ``to_deg``, ``rms_px``, ``max_px``,
            ``pixels``.
        also: ``rms_px`` and ``max_px`` of the other ways to read the model's files
            (:attr:`~cubicfish.models.lens.Lens.also`). The figures
            above are those of the worst way, ``by_angle`` those of the model's own.
        beyond: of the worst way, in what is left of the field out to its rim: ``from_deg``,
            ``to_deg``, ``rms_px``, ``max_px``. None where nothing is left.

    """

    rms_px: float
    max_px: float
    max_angle_deg: float
    by_angle: list[dict[str, float]]
    also: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    beyond: Mapping[str, float] | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            name: value for name, value in vars(self).items() if value is not None and value != {}
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Conversion:
    """A lens that stands for a camera.

    Attributes:
        lens: the lens.
        error: how far it is from the camera.
        lens_from_camera: (3, 3) the turn from the camera's frame to the lens's: poses of
            photos are to be turned by it.
        place: (3,) the lens's one centre in the camera's frame and unit: on the axis, where the
            rays of things at ``distance`` cross most nearly.
        distance: how far away, in the camera's unit, the things are at which the lens is nearest;
            None for distant ones.
        distant: its error for distant things, where it is not for these.

    """

    lens: Lens
    error: ConversionError
    lens_from_camera: FloatArray
    place: FloatArray = field(default_factory=lambda: np.zeros(3))
    distance: float | None = None
    distant: ConversionError | None = None

    @property
    def turned_deg(self) -> float:
        """Angle of the turn."""
        return float(np.rad2deg(Rotation.from_matrix(self.lens_from_camera).magnitude()))

    def moved(self, rotation: FloatArray, translation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Turn a pose camera_from_world, (3, 3) and (3,) in the camera's unit, into the lens's."""
        turn = self.lens_from_camera
        return turn @ rotation, turn @ (translation - self.place)


def to_lens(
    camera: CubicCamera,
    model: type[Lens],
    *,
    max_angle_deg: float | None = None,
    covered_deg: float | None = None,
    distance: float | None = None,
) -> Conversion:
    """Fit a lens of a model to a camera, least squares in pixels over its field.

    Most models are symmetric about an axis, which real lenses are only nearly: the lens's frame is
    turned to where a symmetric lens is nearest. A model of free form keeps the camera's frame.

    Args:
        camera: the camera.
        model: which, as a format has it.
        max_angle_deg: leave out what is farther from the axis; by default the whole field counts.
        covered_deg: how far from the axis corners reached in the calibration: the error is stated
            up to there, and separately beyond, where the camera itself is a guess. The fit
            includes both, so that the lens does not go astray beyond.
        distance: how far away things are, in the camera's unit: the lens is fitted to points about
            that far away, and its place goes where their rays cross. None for distant things; it
            makes no difference where the entrance pupil does not travel.

    Raises:
        FitError: no lens of the model is near, or too little of the field is left.

    """
    if not camera.pupil_travel:
        distance = None
    view = _View.of(camera, distance)
    _, rays, pixel = view.sample(_FIT_PIXELS, max_angle_deg)
    turn = np.eye(3)
    if model.symmetric:
        turn = symmetric_frame(camera, rays, pixel)
    lens = lens_near(model, view.middle, rays @ turn.T, pixel)
    if model.tilts:
        lens, turn = _fit_turned(FreeLens.of(lens, model.unwritten), rays, pixel)
    error = _measure(view, lens, turn, max_angle_deg, covered_deg, every_way=True)
    distant = None
    if distance is not None:
        distant = _measure(_View.of(camera, None), lens, turn, max_angle_deg, covered_deg)
    return Conversion(
        lens=lens,
        error=error,
        lens_from_camera=turn,
        place=np.array([0.0, 0.0, view.middle.place]),
        distance=distance,
        distant=distant,
    )


def lens_near(model: type[L], camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> L:
    """The lens of a model nearest to a camera, least squares in pixels, within the model's limits.

    Args:
        model: which.
        camera: the camera.
        rays: (N, 3) unit rays of its field, in the lens's frame.
        pixel: (N, 2) where the camera sees them.

    Raises:
        FitError: no lens of the model is near.

    """
    own = model.nearest_to(camera, rays, pixel)
    if own is not None:
        return own
    starts = model.starts(camera.radial, float(angle_from_axis(rays).max()))
    found, fixed = nearest_lens(starts, rays, pixel, fixed=model.unwritten), model.unwritten
    for name, (least, most) in model.limits.items():
        index, moved = found.parameter_names.index(name), found.parameters
        moved[index] = np.clip(moved[index], least, most)
        if moved[index] != found.parameters[index]:
            fixed = (*fixed, name)
            found = nearest_lens([found.with_parameters(moved)], rays, pixel, fixed=fixed)
    return found


def symmetric_frame(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> FloatArray:
    """Return the turn (3, 3) of rays (N, 3) after which a symmetric lens fits their pixels best.

    A lens that is decentred or tilted looks most symmetric from an axis of its own, and poses make
    up for the turn.
    """
    return _fit_turned(FreeLens.of(camera.radial), rays, pixel)[1]


def _fit_turned(start: FreeLens[L], rays: FloatArray, pixel: FloatArray) -> tuple[L, FloatArray]:
    """Fit a lens and the turn (3, 3) of rays (N, 3) together, least squares in pixels (N, 2)."""
    from scipy.optimize import least_squares  # it takes long to load, and is seldom needed

    count = len(start.parameters)

    def turned(values: FloatArray) -> tuple[FreeLens[L], FloatArray]:
        return start.with_parameters(values[:count]), Rotation.from_rotvec(values[count:]).apply(
            rays
        )

    def residual(values: FloatArray) -> FloatArray:
        lens, points = turned(values)
        return np.asarray((lens.project(points) - pixel).reshape(-1))

    def slope(values: FloatArray) -> FloatArray:
        lens, points = turned(values)
        _, by_point, by_values = lens.pixel_and_slopes(points)
        by_turn = -by_point @ cross_matrix(points)  # turns are small: of first order
        return np.concatenate([by_values, by_turn], axis=2).reshape(2 * len(rays), -1)

    first = np.concatenate([start.parameters, np.zeros(3)])
    found = least_squares(residual, first, jac=slope, x_scale="jac", max_nfev=100)
    turn = np.asarray(Rotation.from_rotvec(found.x[count:]).as_matrix())
    return start.with_parameters(found.x[:count]).lens, turn


def conversion_error(camera: CubicCamera, lens: Lens) -> ConversionError:
    """Return how far a lens is from a camera, of distant things, on a grid of 40,000 pixels."""
    return _measure(_View.of(camera, None), lens, np.eye(3))


def _measure(
    view: _View,
    lens: Lens,
    turn: FloatArray,
    max_angle_deg: float | None = None,
    covered_deg: float | None = None,
    *,
    every_way: bool = False,
) -> ConversionError:
    """Measure how far a lens, in its turned frame, is from what a camera shows.

    With ``every_way`` the other ways to read the model's files count too: any of them may read
    a file that is written, while a file that was read means the model itself.
    """
    theta, rays, pixel = view.sample(_ERROR_PIXELS, max_angle_deg)
    inside = np.ones(len(rays), bool)
    if covered_deg is not None and (theta <= np.deg2rad(covered_deg)).sum() >= _FEWEST:
        inside = theta <= np.deg2rad(covered_deg)
    ways = lens.also if every_way else {}
    misses = [project(rays @ turn.T) - pixel for project in (lens.project, *ways.values())]
    worst = _measure_miss([miss[inside] for miss in misses])
    end_deg = float(np.rad2deg(theta[inside].max()))
    beyond = None
    if not inside.all():
        to_deg = float(np.rad2deg(theta.max()))
        figures = _measure_miss([miss[~inside] for miss in misses])
        beyond = {"from_deg": end_deg, "to_deg": to_deg, **figures}
    seen = inside & np.isfinite(misses[0]).all(axis=1)
    return ConversionError(
        rms_px=worst["rms_px"],
        max_px=worst["max_px"],
        max_angle_deg=end_deg,
        by_angle=rings(theta[seen], misses[0][seen]) if seen.any() else [],
        also={way: _measure_miss([its[inside]]) for way, its in zip(ways, misses[1:], strict=True)},
        beyond=beyond,
    )


def _measure_miss(misses: Sequence[FloatArray]) -> dict[str, float]:
    """Return the worst RMS and distance of several (N, 2); infinite if a ray is not seen."""
    if not all(np.isfinite(miss).all() for miss in misses):
        return {"rms_px": np.inf, "max_px": np.inf}
    largest = max(float(np.linalg.norm(miss, axis=1).max()) for miss in misses)
    return {"rms_px": max(map(rms_px, misses)), "max_px": largest}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class _SeenFrom(CubicCamera):
    """A camera as things at one distance show it, seen from one place on its axis.

    Attributes:
        distance: how far away they are, in the camera's unit; infinite for distant ones.
        place: on the axis, in the same unit.

    """

    distance: float
    place: float

    def project(self, points: npt.ArrayLike, *, near: bool = False) -> FloatArray:
        """Points (..., 3) of any length, from that place -> pixels (..., 2)."""
        if self.distance == np.inf:
            return super().project(points)
        moved = self.distance * unit_rays(points)
        return super().project(moved + np.array([0.0, 0.0, self.place]), near=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """What a central lens has to show of a camera.

    Attributes:
        camera: the camera.
        seen: it as things at some distances show it, from one place.

    """

    camera: CubicCamera
    seen: tuple[_SeenFrom, ...]

    @classmethod
    def of(cls, camera: CubicCamera, distance: float | None) -> _View:
        """The view of things about ``distance`` away; None for distant ones."""
        place, distances = 0.0, [np.inf]
        if distance is not None:
            place = _central_place(camera)
            distances = [factor * distance for factor in _SPREAD]
        known = {one.name: getattr(camera, one.name) for one in fields(CubicCamera)}
        seen = tuple(_SeenFrom(**known, distance=one, place=place) for one in distances)
        return cls(camera=camera, seen=seen)

    @property
    def middle(self) -> _SeenFrom:
        """The camera as things at the middle distance show it."""
        return self.seen[len(self.seen) // 2]

    def sample(
        self, count: int, max_angle_deg: float | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rays spread evenly over the photo, where the camera sees.

        Returns:
            Angles from the axis (N,), radians; unit rays (N, 3) from the place; pixels (N, 2).

        """
        rays, pixel = _sample_field(self.camera, count, max_angle_deg)
        if self.middle.distance < np.inf:
            each = [np.arange(first, len(rays), len(self.seen)) for first in range(len(self.seen))]
            seen = [one.project(rays[own]) for one, own in zip(self.seen, each, strict=True)]
            rays, pixel = rays[np.concatenate(each)], np.concatenate(seen)
            good = np.isfinite(pixel[:, 0])
            rays, pixel = rays[good], pixel[good]
        return angle_from_axis(rays), rays, pixel


def _central_place(camera: CubicCamera) -> float:
    """Find where on the axis the rays of the photo cross most nearly, in the camera's unit.

    It is the mean of the places where they enter the lens, each weighted by how much a pixel moves
    with it, squared: the pixels of near things then differ least from those of a central lens.
    """
    rays, _ = _sample_field(camera, _FIT_PIXELS, None)
    by_place = camera.pixel_and_slopes(rays, near=False)[1][:, :, 2]
    weight = np.sum(by_place**2, axis=1)
    return float(np.sum(weight * camera.pupil_shift(rays)) / np.sum(weight))


def _sample_field(
    camera: CubicCamera, count: int, max_angle_deg: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return rays (N, 3) and pixels (N, 2) spread evenly over the photo, where the camera sees."""
    pixel = pixel_grid(camera.image_size, count)
    rays = camera.unproject(pixel)
    good = np.isfinite(rays[:, 0])
    if max_angle_deg is not None:
        good[good] = angle_from_axis(rays[good]) <= np.deg2rad(max_angle_deg)
    if good.sum() < _FEWEST:
        raise FitError(
            "too little of the photo lies within that angle of the axis",
            do="choose a larger {max_angle_deg}",
            arguments={"max_angle_deg": "max_angle_deg"},
        )
    return rays[good], pixel[good]
