"""Made-up lenses outside the fitted families, for honest synthetic tests.

:class:`~asymmetric_lens.AsymmetricLens` has the formula of the lens that P is held
to, so what it shows leans on the prior being right. The lenses here differ from it as real ones do,
and none is a member of the cubic's family or of another model of :mod:`cubicfish.models`:

- ``moving-pupil``: the entrance pupil wanders forward as rays come in from the side, so the camera
  is mildly non-central: where a point is seen depends on its distance.
- ``mirror``: a camera below a hyperbolic mirror, a little too near to it, so that it is not
  central either. The middle of the picture, where the camera sees itself, is blind.
- ``equisolid`` and ``orthographic``: profiles of the textbook, with a local bump of half a pixel,
  as a polished surface has.

Glass of the first two is held by three screws, which shifts pixels by 0.15 px at the rim. All are
decentred by a rear group that is turned against the front one, not by Brown's polynomial. Lengths
inside a lens are millimetres: :func:`synthetic_lens` takes the target's unit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray
from cubicfish.angles import columns
from cubicfish.models import angle_from_axis
from cubicfish.scene.truth import rotation_matrix
from cubicfish.target import MILLIMETRES

# A point's angle and its pupil depend on each other: each round gains a factor of the distance
# over the pupil's travel.
_PUPIL_ROUNDS = 30
# In any unit: beside it no lens has a length.
_FAR = 1e6
_FLAW_ROUNDS = 8
_TABLE_STEPS = 4096
_NEWTON_ROUNDS = 2  # from a table of 4096 steps
_SLOPE_STEP = 1e-6


class Profile(Protocol):
    """What a lens of perfect symmetry does to the angle from its axis, all (N,) -> (N,)."""

    def radius(self, angle: FloatArray) -> FloatArray:
        """Angle in radians -> distance from the axis in the picture, 1 per radian at the axis."""

    def angle(self, radius: FloatArray) -> FloatArray:
        """The angle of each radius; NaN where there is none."""

    def pupil(self, angle: FloatArray) -> FloatArray:
        """Where on the axis a ray of this angle starts, millimetres forward of the camera."""


@dataclass(frozen=True, kw_only=True)
class SineProfile:
    """r = sin(share · θ) / share: orthographic at 1, equisolid at 1/2; others lie between.

    Attributes:
        share: see above.
        pupil_mm: how fast the entrance pupil wanders: ``pupil_mm`` · (θ/sin θ − 1), as Gennery
            (2006) has it.

    """

    share: float
    pupil_mm: float = 0.0

    def radius(self, angle: FloatArray) -> FloatArray:
        """See :class:`Profile`."""
        return np.sin(self.share * angle) / self.share

    def angle(self, radius: FloatArray) -> FloatArray:
        """See :class:`Profile`."""
        with np.errstate(invalid="ignore"):
            angle: FloatArray = np.arcsin(self.share * radius) / self.share
        return angle

    def pupil(self, angle: FloatArray) -> FloatArray:
        """See :class:`Profile`."""
        return self.pupil_mm * (1 / np.sinc(angle / np.pi) - 1)


@dataclass(frozen=True, kw_only=True)
class MirrorProfile:
    """A pinhole camera that looks up into a hyperbolic mirror, ray by ray.

    The angle is from straight down, back at the camera. The mirror is the upper sheet of
    (z − c)²/a² − R²/(c² − a²) = 1, whose foci are the lens's own centre at z = 2c and z = 0; a
    pinhole at 0 would make a central camera.

    Attributes:
        a_mm, c_mm: of the hyperbola.
        off_mm: how far above the focus the pinhole is.
        pinhole_angle: the largest angle at the pinhole, radians.

    """

    a_mm: float
    c_mm: float
    off_mm: float
    pinhole_angle: float

    def radius(self, angle: FloatArray) -> FloatArray:
        """See :class:`Profile`."""
        inner = self._inner(angle)
        return np.tan(inner) / self._start_slope

    def angle(self, radius: FloatArray) -> FloatArray:
        """See :class:`Profile`."""
        inner = np.arctan(radius * self._start_slope)
        return np.where(
            inner <= self.pinhole_angle,
            self._traced(np.minimum(inner, self.pinhole_angle))[0],
            np.nan,
        )

    def pupil(self, angle: FloatArray) -> FloatArray:
        """See :class:`Profile`."""
        return self._traced(self._inner(angle))[1]

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        inner = np.linspace(0.0, self.pinhole_angle, _TABLE_STEPS)
        return self._traced(inner)[0], inner

    @cached_property
    def _start_slope(self) -> float:
        """Radians at the pinhole for one outside, at the axis."""
        return _SLOPE_STEP / float(self._traced(np.array([_SLOPE_STEP]))[0][0])

    def _inner(self, angle: FloatArray) -> FloatArray:
        """The angle at the pinhole of each ray outside; beyond the mirror that of its rim."""
        inner = np.interp(angle, *self._table)
        for _ in range(_NEWTON_ROUNDS):
            ahead, behind = (self._traced(inner + step)[0] for step in (_SLOPE_STEP, -_SLOPE_STEP))
            slope = (ahead - behind) / (2 * _SLOPE_STEP)
            inner = np.clip(
                inner + (angle - self._traced(inner)[0]) / slope, 0.0, self.pinhole_angle
            )
        return inner

    def _traced(self, inner: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angle outside and place on the axis of the rays that the pinhole sees at ``inner``."""
        # On the axis itself 0/0 says where it is met; this near to it the limit is reached.
        turn = np.where(inner < 0, -1.0, 1.0)
        inner = np.maximum(np.abs(inner), 1e-7)
        a2 = self.a_mm**2
        b2 = self.c_mm**2 - a2
        across, up, low = np.sin(inner), np.cos(inner), self.off_mm - self.c_mm
        square, half, rest = up**2 / a2 - across**2 / b2, low * up / a2, low**2 / a2 - 1
        # Of the two crossings the farther one is the upper sheet.
        along = (-half + np.sqrt(half**2 - square * rest)) / square
        out, height = along * across, low + along * up
        normal_out, normal_up = -out / b2, height / a2
        double = 2 * (across * normal_out + up * normal_up) / (normal_out**2 + normal_up**2)
        way_out, way_up = across - double * normal_out, up - double * normal_up
        meets = height - out * way_up / way_out
        return turn * np.arctan2(way_out, -way_up), self.c_mm - meets


class Flaw(Protocol):
    """What shifts pixels a little, smoothly."""

    def at(self, pixel: FloatArray) -> FloatArray:
        """The shift of pixels (N, 2) -> (N, 2)."""


@dataclass(frozen=True, kw_only=True)
class Bump:
    """A local flaw: pixels are shifted by ``shift``, less and less away from ``centre``.

    Attributes:
        centre: (x, y), pixels.
        spread_px: standard deviation of its bell shape.
        shift: (x, y) at its middle, pixels.

    """

    centre: tuple[float, float]
    spread_px: float
    shift: tuple[float, float]

    def at(self, pixel: FloatArray) -> FloatArray:
        """The shift of pixels (N, 2) -> (N, 2)."""
        square = (((pixel - self.centre) / self.spread_px) ** 2).sum(axis=-1)
        return np.exp(-square / 2)[..., None] * np.array(self.shift)


@dataclass(frozen=True, kw_only=True)
class Trefoil:
    """Glass held by three screws: a shift that turns back twice while its place goes round.

    Attributes:
        centre: (x, y), pixels.
        radius_px: where the shift is ``amount_px``; it grows with the square of the distance.
        amount_px: see there.

    """

    centre: tuple[float, float]
    radius_px: float
    amount_px: float

    def at(self, pixel: FloatArray) -> FloatArray:
        """The shift of pixels (N, 2) -> (N, 2)."""
        # Far outside every picture it need not grow on.
        x, y = np.clip((pixel - self.centre) / self.radius_px, -9, 9).T
        return self.amount_px * np.stack([x * x - y * y, -2 * x * y], axis=-1)


@dataclass(frozen=True, kw_only=True)
class SyntheticLens:
    """A lens of one axis, about which it is not quite symmetric.

    A point's angle θ is taken at the pupil that rays of that angle go through; the ray leaves the
    front group at θ/2, the rear group is turned by ``turn_deg``, and the profile and the flaw make
    the pixel.

    Attributes:
        image_size: (width, height) in pixels.
        focal: (x, y), pixels per radian at the axis.
        centre: (x, y), where the rear group's axis meets the picture.
        profile: see :class:`Profile`.
        turn_deg: of the rear group about x and about y.
        flaw: of the glass, if there is one.
        min_angle_deg: nothing is seen nearer to the axis.
        max_angle_deg: half the field of view.
        units: of the points; lengths inside the lens are millimetres.

    """

    image_size: tuple[int, int]
    focal: tuple[float, float]
    centre: tuple[float, float]
    profile: Profile
    turn_deg: tuple[float, float] = (0.0, 0.0)
    flaw: Flaw | None = None
    min_angle_deg: float = 0.0
    max_angle_deg: float = 95.0
    units: str = "mm"

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Points in the camera frame (..., 3) -> pixels (..., 2), NaN outside the field.

        Not rays: the distance counts. :attr:`far` is a lens of rays.
        """
        points = np.asarray(points, float)
        shape = points.shape[:-1]
        points = points.reshape(-1, 3)
        x, y, z = columns(points)
        across = np.hypot(x, y)
        angle, change = np.arctan2(across, z), np.zeros(len(points))
        for _ in range(_PUPIL_ROUNDS):
            before = angle
            angle = np.arctan2(across, z - self._pupil(np.clip(angle, self._least, self._most)))
            change = np.abs(angle - before)
            if not np.nan_to_num(change).max(initial=0.0) > 1e-12:
                break
        # What does not settle is as near as the lens is long.
        seen = self._in_field(angle) & ((across > 0) | (z > 0)) & (change < 1e-9)
        angle = np.where(seen, angle, 0.0)
        # On the axis there is no side to go to, and none is needed.
        half = np.sin(angle / 2) / np.where(across > 0, across, 1.0)
        behind = np.column_stack([points[:, :2] * half[:, None], np.cos(angle / 2)])
        turned = behind @ self._turn.T
        bent = 2 * angle_from_axis(turned)
        length = np.hypot(turned[:, 0], turned[:, 1])
        scale = self.profile.radius(bent) / np.where(length > 0, length, 1.0)
        pixel = turned[:, :2] * scale[:, None] * self.focal + self.centre
        if self.flaw is not None:
            pixel = pixel + self.flaw.at(pixel)
        return np.where(seen[:, None], pixel, np.nan).reshape(*shape, 2)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit directions (..., 3), NaN outside the field.

        The ray starts where :meth:`ray_starts` says, not at the camera's centre.
        """
        pixel = np.asarray(pixel, float)
        shape = pixel.shape[:-1]
        pixel = pixel.reshape(-1, 2)
        plain = pixel
        if self.flaw is not None:
            for _ in range(_FLAW_ROUNDS):
                plain = pixel - self.flaw.at(plain)
        flat = (plain - self.centre) / self.focal
        radius = np.hypot(flat[:, 0], flat[:, 1])
        half = self.profile.angle(radius) / 2
        scale = np.sin(half) / np.where(radius > 0, radius, 1.0)
        behind = np.column_stack([flat * scale[:, None], np.cos(half)]) @ self._turn
        angle = 2 * angle_from_axis(behind)
        length = np.hypot(behind[:, 0], behind[:, 1])
        scale = np.sin(angle) / np.where(length > 0, length, 1.0)
        rays = np.column_stack([behind[:, :2] * scale[:, None], np.cos(angle)])
        rays[~self._in_field(angle)] = np.nan
        return rays.reshape(*shape, 3)

    def ray_starts(self, rays: FloatArray) -> FloatArray:
        """Where rays (..., 3) of :meth:`unproject` start: z (...) on the axis, in points' units."""
        angle = angle_from_axis(rays)
        return np.where(np.isfinite(angle), self._pupil(np.nan_to_num(angle)), 0.0)

    @property
    def far(self) -> RaysAtDistance:
        """The lens of rays that it is for what is far away."""
        return RaysAtDistance(lens=self, centre=0.0, distance=_FAR)

    @property
    def _least(self) -> float:
        return float(np.radians(self.min_angle_deg))

    @property
    def _most(self) -> float:
        return float(np.radians(self.max_angle_deg))

    @property
    def _turn(self) -> FloatArray:
        return rotation_matrix(np.radians([*self.turn_deg, 0.0]))

    def _pupil(self, angle: FloatArray) -> FloatArray:
        return self.profile.pupil(angle) / MILLIMETRES.get(self.units, 1.0)

    def _in_field(self, angle: FloatArray) -> npt.NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return (angle >= self._least) & (angle <= self._most)


@dataclass(frozen=True, kw_only=True)
class RaysAtDistance:
    """A lens of rays, for what takes central cameras; see :attr:`SyntheticLens.far`.

    Attributes:
        lens: the lens behind it.
        centre: z of where rays start, in the frame of ``lens``.
        distance: how far away points are.

    """

    lens: SyntheticLens
    centre: float
    distance: float

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.lens.image_size

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Rays of any length (..., 3) -> pixels (..., 2)."""
        points = np.asarray(points, float)
        length = np.linalg.norm(points, axis=-1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            far = points / length * self.distance
        return self.lens.project(far + np.array([0, 0, self.centre]))

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit rays (..., 3) from the centre."""
        way = self.lens.unproject(pixel)
        start = np.zeros(way.shape)
        start[..., 2] = self.lens.ray_starts(way) - self.centre
        # |start + t·way| = distance, t > 0.
        along = (start * way).sum(axis=-1, keepdims=True)
        rest = (start * start).sum(axis=-1, keepdims=True) - self.distance**2
        return (start + (np.sqrt(along**2 - rest) - along) * way) / self.distance


@dataclass(frozen=True)
class _Made:
    """How a lens is made, in shares of the photo's shorter side.

    Attributes:
        profile: of the lens.
        rim: its radius at the rim of the field, 1 per radian at the axis.
        taller: how much larger the focal length is down the picture than across.
        off: how far right and down of the photo's middle the centre is.
        turn_deg: of the rear group.
        bump: where the glass has one, in shares of width and height; held by screws without.
        field_deg: nothing is seen nearer to the axis, or farther from it.

    """

    profile: Profile
    rim: float
    taller: float
    off: tuple[float, float]
    turn_deg: tuple[float, float]
    bump: tuple[float, float] | None
    field_deg: tuple[float, float]


_PUPIL, _MIRROR = (
    SineProfile(share=0.31, pupil_mm=1.0),
    MirrorProfile(a_mm=15.0, c_mm=25.0, off_mm=1.0, pinhole_angle=0.62),
)
_MADE = {
    "moving-pupil": _Made(
        _PUPIL, 1.6, 1.0015, (0.006, -0.009), (0.25, -0.15), None, (0.0, 96.0)
    ),
    "mirror": _Made(
        _MIRROR, 2.8, 1.0, (-0.005, 0.004), (0.1, 0.2), None, (15.0, 105.0)
    ),
    "equisolid": _Made(
        SineProfile(share=0.5), 1.475, 0.999, (-0.008, 0.005), (-0.2, 0.3), (0.62, 0.3), (0.0, 95.0)
    ),
    "orthographic": _Made(
        SineProfile(share=1.0), 0.985, 1.001, (0.004, 0.007), (0.2, 0.2), (0.42, 0.66), (0.0, 80.0)
    ),
}  # fmt: skip


SYNTHETIC_LENSES = tuple(_MADE)


def synthetic_lens(
    name: str, image_size: tuple[int, int] = (960, 720), *, units: str = "mm"
) -> SyntheticLens:
    """A lens of :data:`SYNTHETIC_LENSES` whose round picture just fits the photo's shorter side.

    Args:
        name: of :data:`SYNTHETIC_LENSES`.
        image_size: (width, height) in pixels.
        units: of the target, for what is a length inside the lens; one that is none is taken as mm.

    """
    made, short = _MADE[name], min(image_size)
    focal, middle = 0.52 * short / made.rim, _off_middle(image_size, 0.0, 0.0)
    flaw: Flaw = Trefoil(centre=middle, radius_px=0.5 * short, amount_px=0.15)
    if made.bump is not None:
        across, down = made.bump
        place = (across * image_size[0], down * image_size[1])
        flaw = Bump(centre=place, spread_px=0.1 * short, shift=(0.4, -0.3))
    return SyntheticLens(
        image_size=image_size,
        focal=(focal, made.taller * focal),
        centre=_off_middle(image_size, *made.off),
        profile=made.profile,
        turn_deg=made.turn_deg,
        flaw=flaw,
        min_angle_deg=made.field_deg[0],
        max_angle_deg=made.field_deg[1],
        units=units,
    )


def _off_middle(size: tuple[int, int], right: float, down: float) -> tuple[float, float]:
    """A point off the middle of the photo by shares of its shorter side."""
    short = min(size)
    return (size[0] - 1) / 2 + right * short, (size[1] - 1) / 2 + down * short
