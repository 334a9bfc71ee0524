"""Uncertainty of the camera from how much it depends on single photos.

Corners of one photo share their errors: its blur, its light, the sheet's own bend in it, and what
the model misses. The noise of single corners, carried through the fit, knows nothing of that. What
does is how far the camera moves when a photo is left out: a variance estimate that is robust to
errors shared within clusters, the photos (Liang & Zeger 1986; Bell & McCaffrey 2002).

Leaving photos out does not show which prior of P is right either. The squared distances to cameras
under other priors are added, weighted by how often other photos would have chosen them (as in the
averaging of models, Buckland, Burnham & Augustin 1997); likewise where held-out photos cannot
decide whether the target should be refined further. And in a middle without any corner, where a
mirror camera sees itself, P and the lens of its prior are two guesses: they are off by their
difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.decentred import DecentredFit
from cubicfish.fit.folds import dealt_out
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.nearest_cubic import MARGIN_DEG
from cubicfish.fit.uncertainty import FarSlopes, Uncertainty, camera_uncertainty
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.chances import normal_quantile, student_quantile
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# More clusters say little more, and each costs a linear system.
MOST_CLUSTERS = 24
_RAYS = 300
_WITHIN = 0.95  # of one side: 0.9 between both


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoSpread:
    """How far the camera moves without each cluster of photos.

    Attributes:
        noise: the part of the corners' own noise, which is a lower bound.
        left_out: (G, K) steps of the lens's parameters without each cluster.
        influence: (G, K) steps without the cluster's gradient, its part of the Hessian kept.
        runner_up: (R, K) steps to other lenses that may be better (that of a target refined
            further, those of other priors), each times the root of its probability.
        prior_lens: the lens of P's prior, in P's frame.
        empty: angle from the axis within which no corner lies, nor near it, radians.

    """

    noise: Uncertainty
    left_out: FloatArray
    influence: FloatArray
    runner_up: FloatArray
    prior_lens: DecentredFit
    empty: float

    @property
    def noise_px(self) -> float:
        """Standard deviation of a corner's coordinate, pixels."""
        return self.noise.noise_px

    def sigma_px(self, rays: FloatArray) -> FloatArray:
        """sqrt(var x + var y) of the pixels of distant points: (N, 3) -> (N,), pixels."""
        slopes = FarSlopes.of(self.noise.gauge.lens, rays)
        left_out, influence, runner_up = self._measure_changes(slopes)
        of_photos = self._estimate_variance(left_out, influence).reshape(-1, 2).sum(axis=1)
        of_prior = np.square(runner_up).sum(axis=1).reshape(-1, 2).sum(axis=1)
        of_guess = np.square(self._compare_guesses(rays)).sum(axis=1)
        of_noise = np.square(self.noise.sigma_px(slopes))
        return np.sqrt(np.maximum(of_noise, of_photos) + of_prior + of_guess)

    def variance(self, rays: FloatArray, weights: FloatArray) -> FloatArray:
        """See :class:`~cubicfish.fit.uncertainty.Uncertainty`."""
        left_out, influence, runner_up = (
            weights @ change for change in self._measure_changes(rays)
        )
        of_photos = self._estimate_variance(left_out, influence)
        of_prior = np.square(runner_up).sum(axis=1)
        of_guess = np.square(weights @ self._compare_guesses(rays).reshape(-1))
        return np.maximum(self.noise.variance(rays, weights), of_photos) + of_prior + of_guess

    def _compare_guesses(self, rays: FloatArray) -> FloatArray:
        """(N, 2) the difference of the two guesses at rays of an empty middle; 0 elsewhere."""
        if not self.empty:
            return np.zeros((len(rays), 2))
        lens = self.noise.gauge.lens
        assert isinstance(lens, CubicFit)
        differ = lens.far(rays) - self.prior_lens.project(rays)
        return np.where(rays[:, 2:] > np.cos(self.empty), differ, 0.0)

    def _estimate_variance(self, left_out: FloatArray, influence: FloatArray) -> FloatArray:
        """Variances (F,) from changes (F, G) without each cluster.

        With leverage h, leaving out divides squared residuals by (1 - h)² (HC3), influence by
        nothing (HC0). The product of the two divides by 1 - h, cluster by cluster, which is
        unbiased where errors are alike (HC2; MacKinnon & White 1985), however large h is.
        """
        clusters = left_out.shape[1]
        if clusters < 2:
            return np.zeros(len(left_out))
        once, none = (
            change - change.mean(axis=1, keepdims=True) for change in (left_out, influence)
        )
        return variance_of_few(np.sum(once * none, axis=1), clusters)

    def _measure_changes(
        self, rays: FloatArray | FarSlopes
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """How the pixels of rays move (2N, steps), without the common turn.

        They move by each step of ``left_out``, of ``influence`` and of ``runner_up``.
        """
        change = self.noise.gauge.by_lens(rays)
        left_out, influence, runner_up = (
            change @ steps.reshape(-1, change.shape[1]).T
            for steps in (self.left_out, self.influence, self.runner_up)
        )
        return left_out, influence, runner_up


def variance_of_few(variance: FloatArray, clusters: int) -> FloatArray:
    """Enlarge variances, of any shape, that were estimated from only a few clusters.

    A variance that is itself estimated from few is below the true one more often than above it.
    It is enlarged so that errors exceed the bound that nine in ten should stay within, 1.645 times
    its root, as often as they would with the true one: by Student's t.
    """
    larger = (student_quantile(clusters - 1, _WITHIN) / normal_quantile(_WITHIN)) ** 2
    return variance * larger


def photo_spread(
    fit: CameraFit, places: IntArray, doubted: Sequence[tuple[CubicFit, float]] = ()
) -> PhotoSpread:
    """Leave out the photos of a fit, cluster by cluster, to first order.

    Args:
        fit: the fit, at its optimum.
        places: (M,) the place that each photo is from, counted from 0: photos from one place are
            left out together.
        doubted: other lenses, and how likely each is the better one, 0 to 1.

    """
    reference, count = fit.reference, len(fit.lens.parameters)
    leave_one_out = LeaveOneOut(fit, _group_photos(places, reference.pairs))
    prior = fit.lens.tie
    assert prior is not None
    rays = cone_rays(reference.covered, _RAYS)
    others = [np.sqrt(likely) * _measure_step(fit.lens, lens, rays) for lens, likely in doubted]
    if fit.runners_up:
        steps = leave_one_out.steps_under(
            [prior.apply(fit.lens, reference, fit.errors) for prior in fit.runners_up]
        )
        others += list(np.sqrt([*fit.runners_up.values()])[:, None] * steps[:, :count])
    return PhotoSpread(
        noise=camera_uncertainty(fit),
        left_out=np.array([shared[:count] for shared, _, _ in leave_one_out.steps()]),
        influence=leave_one_out.influence()[:, :count],
        runner_up=np.array(others),
        prior_lens=prior.nearest(fit.lens.far(prior.near.rays))[0],
        empty=max(reference.covered_angles[0] - np.deg2rad(MARGIN_DEG), 0.0),
    )


def _measure_step(lens: CubicFit, other: CubicFit, rays: FloatArray) -> FloatArray:
    """The step (K,) from a lens to another, whose parameters may be scaled otherwise."""
    _, _, by_lens = lens.far_jacobian(rays)
    change = (other.far(rays) - lens.far(rays)).reshape(-1)
    return np.asarray(np.linalg.lstsq(by_lens.reshape(len(change), -1), change, rcond=None)[0])


def _group_photos(places: IntArray, pairs: Observations) -> list[IntArray]:
    """Group the photos in which some corner tells its error, those from one place together."""
    known = np.unique(pairs.image[pairs.error_known])
    _, place = np.unique(places[known], return_inverse=True)
    clusters = min(int(place.max(initial=-1)) + 1, MOST_CLUSTERS)
    if clusters < 2:
        return []
    images = [pairs.images[photo] for photo in known]
    return [known[part] for part in dealt_out(place, images, clusters)]
