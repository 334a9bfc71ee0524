"""Fitting the radial reference and all poses, from nothing."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice, pairwise, product
from typing import Any, TypeVar

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.errors import FitError
from cubicfish.fit.nearest_cubic import (
    MARGIN_DEG,
    NearestCubic,
    nearest_cubic,
)
from cubicfish.fit.start import NONE_PLACED, fit_poses, start_at_centre
from cubicfish.judge.codes import Code
from cubicfish.judge.finding import Finding
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.fit_lens import FreeLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import gross_px, noise_px, wide_px
from cubicfish.solve.subset import select_photos
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray

T = TypeVar("T")
RadialAdjustment = Adjustment[FreeLens[RadialCamera]]

CHECK_ALL = (
    "check the target's square sizes, axes and origins, that corners are counted and not squares, "
    "and that all photos show this one target through one lens at one zoom"
)
"""What to do where corners fit no lens at all."""
# A fit whose noise is above this share of the photo's longer side is not accepted.
_POOR_SHARE = 0.004
# A start whose photos are off by more than this share of it in the median leads nowhere, and
# neither does a first fit that is so many times as noisy as an accepted one.
_HOPELESS_SHARE = 0.1
_HOPELESS = 4.0
_FIRST_ITERATIONS = 30
# Centres that are tried where the middle of the photo does not serve, as shares of its sides.
_CENTRE_SHARES = (-0.24, -0.12, 0.0, 0.12, 0.24)
_CENTRES_TO_FIT = 4
# Photos that take part in ranking the centres.
_PHOTOS_FOR_CENTRE = 8
# The first fit sets a photo aside when its start is this many times worse than the median.
_BAD_START = 6.0
_ROUNDS = 3
# Added photos may make the others this many times as noisy.
_PULLED_AWAY = 2.0
# A profile with fewer coefficients may be noisier by this factor.
_LOSS_PER_TERM = 1.05
_ALL_TERMS = 4
# A step that lowers the cost by a smaller share is taken without evaluating it.
_NEAR_DECREASE = 1e-8
# For fits that another fit follows at once.
_ROUGH_DECREASE = 1e-5
_CUBIC = "cubic"
LOST_PX = 10.0
"""The error, at first, of a corner that a known lens does not see."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialReference(RadialAdjustment):
    """The Kannala–Brandt lens adjusted to the photos that fit it.

    Attributes:
        unfit: why each photo was left out that was, by name.
        focal_uncertainty: standard deviation of the focal length, as a share of it.

    """

    unfit: dict[str, Finding]
    focal_uncertainty: float
    _found: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False)
    _known_cubic: NearestCubic | None = None

    @property
    def camera(self) -> RadialCamera:
        """The lens itself."""
        return self.lens.lens

    @property
    def terms(self) -> int:
        """How many coefficients of the radial profile are in use."""
        return len(self.lens.free) - 4

    def followed(self, world: FloatArray) -> RadialReference:
        """The same lens, and what was found of it, for world points (N, 3) that moved a little."""
        follower = replace(self, pairs=self.pairs.with_world(world))
        follower._found.update(self._found)
        return follower

    def once(self, what: Hashable, find: Callable[[], T]) -> T:
        """Find something of this lens where it is not known yet, and keep it under this key."""
        if what not in self._found:
            self._found[what] = find()
        found: T = self._found[what]
        return found

    def known(self, what: Hashable) -> Any:
        """What was found of this lens under this key; None where nothing was."""
        return self._found.get(what)

    @property
    def cubic(self) -> NearestCubic:
        """The cubic that comes nearest to the lens."""

        def find() -> NearestCubic:
            return nearest_cubic(self.camera, self.covered_angles, self._known_cubic)

        return self.once(_CUBIC, find)

    @property
    def covered(self) -> float:
        """Angle from the axis of the farthest corner that is no outlier, radians."""
        return self.covered_angles[1]

    @cached_property
    def covered_angles(self) -> tuple[float, float]:
        """Angles from the axis of the nearest and the farthest corner that is no outlier, radians.

        In the middle of a mirror camera's picture is the camera itself.
        """
        angle = angle_from_axis(self.poses.apply(self.pairs.image, self.pairs.world))
        length = np.hypot(self.residual[:, 0], self.residual[:, 1])
        good = angle[length <= gross_px(self.errors)]
        return float(good.min()), float(good.max())


def fit_radial(pairs: Observations, *, thorough: bool = True) -> RadialReference:
    """Fit a Kannala–Brandt lens and the pose of every photo, without any guess.

    Photos that do not fit the lens of the others are tried again with that lens; those that still
    do not fit are left out and named.

    Args:
        pairs: 2D-3D pairs.
        thorough: try other centres of the lens where the photo's middle does not serve.

    Raises:
        FitError: no photo can be placed, or the corners do not fit the target.

    """
    # Photos without any pair would shift the others' indices further on.
    pairs = select_photos(pairs, np.arange(len(pairs.images)))
    fit, used = _fit_first(pairs, thorough)
    unfit: dict[str, Finding] = {}
    for round_ in range(_ROUNDS):
        missing = np.setdiff1d(np.arange(len(pairs.images)), used)
        before = len(used)
        fit, used, refused = _add_missing(fit, used, pairs, missing, again=round_ > 0)
        if len(used) > before:
            fit = _follow_residuals(fit)
        unfit = {
            pairs.images[photo]: refused.get(
                photo, Finding(code=Code.TOO_FEW_CORNERS, images=(pairs.images[photo],))
            )
            for photo in np.setdiff1d(missing, used).tolist()
        }
        bad = _find_bad_photos(fit, gross_px(fit.residual))
        unfit |= {fit.pairs.images[photo]: why for photo, why in bad.items()}
        if not bad:
            break
        good = np.setdiff1d(np.arange(len(used)), list(bad))
        if 2 * len(good) < len(used) or not len(good):
            raise _explain_misfit(noise_px(fit.residual))
        own, used = select_photos(fit.pairs, good), used[good]
        limit = gross_px(fit.residual)
        fit = adjust(fit.lens, fit.poses[good], own, limit, relative_decrease=_ROUGH_DECREASE)
        fit = _follow_residuals(fit)
        if set(np.setdiff1d(np.arange(len(pairs.images)), used)) == set(missing.tolist()):
            break
    return _make_sound(fit, unfit)


def radial_near(camera: RadialCamera, pairs: Observations, poses: Poses) -> RadialReference:
    """The reference of a known calibration, adjusted to its pairs again.

    Args:
        camera: its radial lens.
        pairs: the pairs, world points of order 1.
        poses: camera_from_world of each photo under that lens.

    """
    miss = camera.project(poses.apply(pairs.image, pairs.world)) - pairs.pixel
    errors = np.nan_to_num(miss, nan=LOST_PX)[pairs.error_known]
    return _refit(FreeLens.of(camera), poses, pairs, errors, {})


def refit_radial(reference: RadialReference, pairs: Observations, poses: Poses) -> RadialReference:
    """Adjust a reference to other pairs of the same lens, from known poses.

    This serves for pairs without the outliers, and for the training part of a fold.
    """
    fit = _refit(reference.lens, poses, pairs, reference.errors, reference.unfit)
    known = reference._found.get(_CUBIC, reference._known_cubic)
    return replace(fit, _known_cubic=known)


def _refit(
    lens: FreeLens[RadialCamera],
    poses: Poses,
    pairs: Observations,
    errors: FloatArray,
    unfit: dict[str, Finding],
) -> RadialReference:
    fit = adjust(
        lens, poses, pairs, wide_px(errors), relative_decrease=_NEAR_DECREASE, damping=WARM_DAMPING
    )
    return _make_sound(fit, unfit)


def _make_sound(fit: RadialAdjustment, unfit: dict[str, Finding]) -> RadialReference:
    """The reference of a fit, with a profile that grows over the whole valid cone."""
    fit = _drop_terms(fit)
    variance = noise_px(fit.residual) ** 2
    covariance = np.linalg.pinv(fit.normal.reduced_shared(), hermitian=True) * variance
    focal = np.sqrt(max(covariance[0, 0], covariance[1, 1], 0.0)) / abs(fit.lens.lens.fx)
    return RadialReference(**vars(fit), unfit=unfit, focal_uncertainty=float(focal))


def _explain_misfit(error: float) -> FitError:
    size = f"{error:.0f}" if error >= 10 else f"{error:.2g}"
    return FitError(
        f"the corners do not fit the target (typical error {size} px)",
        do=CHECK_ALL,
    )


def _fit_first(pairs: Observations, thorough: bool) -> tuple[RadialAdjustment, IntArray]:
    poor = _POOR_SHARE * max(pairs.image_size)
    found = []
    for centre in islice(_rank_centres(pairs), None if thorough else 1):
        tried = _fit_from_centre(pairs, centre)
        if tried is not None:
            fit, used = tried
            if noise_px(fit.residual) <= _HOPELESS * poor:
                fit = _follow_residuals(_refit_terms(fit, _ALL_TERMS))
            found.append((noise_px(fit.residual), fit, used))
        if found and found[-1][0] <= poor:
            break
    if not found:
        raise FitError(NONE_PLACED)
    error, fit, used = min(found, key=lambda one: one[0])
    if error > poor:
        raise _explain_misfit(error)
    return fit, used


def _rank_centres(pairs: Observations) -> Iterator[FloatArray]:
    """The middle of the photo, then the best-ranked other centres, if the middle does not serve."""
    size = np.array(pairs.image_size, float)
    middle = (size - 1) / 2
    yield middle
    counts = np.bincount(pairs.image, minlength=len(pairs.images))
    few = select_photos(pairs, np.argsort(-counts, kind="stable")[:_PHOTOS_FOR_CENTRE])
    centres = [middle + size * away for away in product(_CENTRE_SHARES, repeat=2) if any(away)]
    scores = [start_at_centre(few, centre).score for centre in centres]
    for index in np.argsort(scores, kind="stable")[:_CENTRES_TO_FIT]:
        yield centres[index]


def _fit_from_centre(
    pairs: Observations, centre: FloatArray
) -> tuple[RadialAdjustment, IntArray] | None:
    """Fit two coefficients: while poses are rough, four would bend to their errors."""
    start = start_at_centre(pairs, centre)
    placed = np.isfinite(start.error)
    if not placed.any():
        return None
    size, typical = max(pairs.image_size), float(np.median(start.error[placed]))
    limit = max(0.02 * size, _BAD_START * typical)
    used = np.flatnonzero(start.error <= limit)
    own = select_photos(pairs, used)
    camera = RadialCamera.from_parameters(
        [start.focal, start.focal, *centre, 0, 0, 0, 0], pairs.image_size
    )
    fit = adjust(
        _free_terms(camera, 2),
        start.poses[used],
        own,
        max(20.0, 2 * float(np.median(start.error[used]))),
        max_iterations=1 if typical > _HOPELESS_SHARE * size else _FIRST_ITERATIONS,
        relative_decrease=_ROUGH_DECREASE,
    )
    return fit, used


def _free_terms(camera: RadialCamera, terms: int) -> FreeLens[RadialCamera]:
    """A lens with so many free coefficients of the profile."""
    return FreeLens.of(camera, fixed=terms_beyond(terms))


def terms_beyond(terms: int) -> list[str]:
    """Names of the profile's coefficients that are not in use."""
    return [f"k{power}" for power in range(terms + 1, _ALL_TERMS + 1)]


def _refit_terms(fit: RadialAdjustment, terms: int) -> RadialAdjustment:
    camera = fit.lens.lens
    camera = replace(camera, k=np.where(np.arange(_ALL_TERMS) < terms, camera.k, 0.0))
    limit = wide_px(fit.residual)
    return adjust(
        _free_terms(camera, terms), fit.poses, fit.pairs, limit, relative_decrease=_NEAR_DECREASE
    )


def _follow_residuals(fit: RadialAdjustment) -> RadialAdjustment:
    """Continue with a loss that follows the residuals down to the noise."""
    fit = fit.again(relative_decrease=_ROUGH_DECREASE, damping=WARM_DAMPING)
    return fit.again(damping=WARM_DAMPING)


def _add_missing(
    fit: RadialAdjustment, used: IntArray, pairs: Observations, missing: IntArray, *, again: bool
) -> tuple[RadialAdjustment, IntArray, dict[int, Finding]]:
    """Add the photos that the start set aside, placed with the lens that the others gave.

    Where these pull the others' corners away from a lens that fitted, photos that are grossly wrong
    under that lens are refused: a few corners say little about their photo's pose, and a pose that
    is far off may turn a good lens into another. A photo that is the first to show how the lens
    continues at the rim pulls nobody away; one that is tried ``again`` has to fit.

    Returns:
        The fit, its photos, and why each photo that could be placed was refused.

    """
    if not missing.size:
        return fit, used, {}
    found, _, placed = fit_poses(fit.lens.lens, select_photos(pairs, missing))
    if found is None:
        return fit, used, {}
    # Those that go astray would delay all others.
    firm = np.flatnonzero(~_find_undetermined(found, noise_px(fit.residual)))
    photos = missing[placed]
    if not again:
        joined, everyone = _join_photos(fit, used, pairs, found.poses[firm], photos[firm])
        others = np.isin(select_photos(pairs, everyone).image, np.searchsorted(everyone, used))
        if noise_px(joined.residual[others]) <= _PULLED_AWAY * noise_px(fit.residual):
            return joined, everyone, {}
    wrong = _find_bad_photos(found, gross_px(fit.residual))
    refused = {int(photos[photo]): why for photo, why in wrong.items()}
    good = np.setdiff1d(firm, list(wrong))
    if not good.size:
        return fit, used, refused
    return *_join_photos(fit, used, pairs, found.poses[good], photos[good]), refused


def _join_photos(
    fit: RadialAdjustment, used: IntArray, pairs: Observations, poses: Poses, photos: IntArray
) -> tuple[RadialAdjustment, IntArray]:
    """Fit photos that are used already and others, whose poses are known roughly."""
    everyone = np.concatenate([used, photos])
    order = np.argsort(everyone, kind="stable")
    poses, everyone = Poses.joined([fit.poses, poses])[order], everyone[order]
    own, limit = select_photos(pairs, everyone), wide_px(fit.residual)
    return adjust(fit.lens, poses, own, limit, relative_decrease=_ROUGH_DECREASE), everyone


def _find_bad_photos(fit: Adjustment[Any], limit: float) -> dict[int, Finding]:
    """Find photos of which most corners are off by more than a limit in pixels, with the reason.

    Photos whose corners do not determine where they were taken from are bad too: they go astray
    without end.
    """
    length = np.hypot(fit.residual[:, 0], fit.residual[:, 1])
    pairs = fit.pairs
    bounds = np.searchsorted(pairs.image, np.arange(len(pairs.images) + 1))
    open_ = _find_undetermined(fit, noise_px(fit.residual))
    bad = {}
    for photo, (first, stop) in enumerate(pairwise(bounds.tolist())):
        images, typical = (pairs.images[photo],), float(np.median(length[first:stop]))
        if typical > limit:
            figures = {"error_px": typical}
            bad[photo] = Finding(code=Code.DOES_NOT_FIT, images=images, figures=figures)
        elif open_[photo]:
            bad[photo] = Finding(code=Code.TOO_FEW_CORNERS, images=images)
    return bad


def _find_undetermined(fit: Adjustment[Any], noise: float) -> BoolArray:
    """Find photos (M,) whose corners, at this noise in pixels, leave a turn or the distance open.

    Open means a turn to a radian, or a shift to the distance itself: beyond that a pose is not
    known at all, and its linear approximation says nothing.
    """
    far = np.linalg.norm(fit.poses.translation, axis=1)[:, None]
    unit = np.hstack([np.ones((len(far), 3)), np.repeat(far, 3, axis=1)])
    known = fit.normal.pose * unit[:, :, None] * unit[:, None, :]
    return np.asarray(np.linalg.eigvalsh(known)[:, 0] < noise**2)


def _drop_terms(fit: RadialAdjustment) -> RadialAdjustment:
    """Remove coefficients until the profile grows over the whole valid cone.

    A lens that really flattens out just beyond its corners (an orthographic fisheye does) fits much
    worse with fewer coefficients: it keeps them all, and its valid cone ends at the fold.
    """
    terms = len(fit.lens.free) - 4
    worst = _LOSS_PER_TERM * noise_px(fit.residual)
    best = fit
    for fewer in range(terms, -1, -1):
        if fewer < terms:
            fit = _refit_terms(fit, fewer)
        if noise_px(fit.residual) > worst:
            break
        near = np.hypot(fit.residual[:, 0], fit.residual[:, 1]) <= gross_px(fit.residual)
        covered = angle_from_axis(fit.poses.apply(fit.pairs.image, fit.pairs.world))[near].max()
        if fit.lens.lens.max_angle >= min(np.pi, covered + np.deg2rad(MARGIN_DEG + 0.5)):
            return fit
    return best
