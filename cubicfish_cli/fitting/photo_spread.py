"""How far the camera may be off, by how much it hangs on single photos.

Corners of one photo share their errors: its blur, its light, the sheet's own bend in it, and what
the model misses. The noise of single corners, carried through the fit, knows nothing of that. What
does is how far the camera moves when a photo is left out: a variance estimate that is robust to
errors shared within clusters, the photos (Liang & Zeger 1986; Bell & McCaffrey 2002).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.cubic_fit import CubicResult
from cubicfish_cli.fitting.left_out import Leaving
from cubicfish_cli.fitting.poses import cross_matrix
from cubicfish_cli.fitting.robust import huber_px
from cubicfish_cli.fitting.uncertainty import Uncertainty, camera_uncertainty
from cubicfish_cli.model.soundness import cone_rays

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

# More clusters than that say little more, and each costs a linear system.
_MOST_CLUSTERS = 24
# Rays over which the turn that two cameras may differ by is taken out.
_ALIGNED_RAYS = 300
# A variance that is itself estimated from few clusters leaves a spread as Student's t has it, which
# is infinite with two degrees of freedom.
_LEAST_FREEDOM = 2.5


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoSpread:
    """How far the camera moves without each cluster of photos.

    Attributes:
        noise: the part of the corners' own noise, which is a lower bound.
        left_out: (G, K) steps of the lens's parameters without each cluster.
        influence: (G, K) steps with the cluster's pull gone, but not its weight.
        aligned: (M, 3) unit rays over which a common turn is taken out.

    """

    noise: Uncertainty
    left_out: FloatArray
    influence: FloatArray
    aligned: FloatArray

    @property
    def noise_px(self) -> float:
        """Standard deviation of a corner's coordinate, pixels."""
        return self.noise.noise_px

    def sigma_px(self, rays: FloatArray) -> FloatArray:
        """sqrt(var x + var y) of the pixels of distant points: (N, 3) -> (N,), pixels.

        Leaving clusters out overstates the variance by their leverage twice, their influence
        alone understates it by none: the geometric mean takes it once, which is unbiased where
        clusters are alike (HC2; MacKinnon & White 1985).
        """
        of_noise = self.noise.sigma_px(rays)
        clusters = len(self.left_out)
        if clusters < 2:
            return of_noise
        square = np.sqrt(self._variance(self.left_out, rays) * self._variance(self.influence, rays))
        freedom = max(clusters - 1, _LEAST_FREEDOM)
        of_photos: FloatArray = np.sqrt(square * freedom / (freedom - 2))
        return np.maximum(of_noise, of_photos)

    def _variance(self, steps: FloatArray, rays: FloatArray) -> FloatArray:
        """(N,) of the jackknife: (G − 1)/G times the sum of squares about the mean."""
        lens = self.noise.result.lens
        _, by_ray, by_lens = lens.project_jacobian(self.aligned)
        turned = (-by_ray @ cross_matrix(self.aligned)).reshape(-1, 3)
        moved = (by_lens @ steps.T).reshape(-1, len(steps))
        turn = np.linalg.lstsq(turned, moved, rcond=None)[0]
        _, by_ray, by_lens = lens.project_jacobian(rays)
        change = by_lens @ steps.T - (-by_ray @ cross_matrix(rays)) @ turn
        change -= change.mean(axis=2, keepdims=True)
        share = (len(steps) - 1) / len(steps)
        return np.asarray(share * np.sum(np.square(change), axis=(1, 2)))


def photo_spread(
    result: CubicResult, pairs: Correspondences, places: IntArray, covered: float
) -> PhotoSpread:
    """Leave out the photos of a cubic fit, cluster by cluster, to first order.

    Args:
        result: the fit, at its optimum.
        pairs: its pairs.
        places: (M,) from which place each photo is, counted from 0: those from one place are one.
        covered: angle from the axis of the farthest corner, radians.

    """
    count = len(result.lens.parameters)
    leaving = Leaving(result.fit, pairs, huber_px(result.residual), _clusters(places))
    return PhotoSpread(
        noise=camera_uncertainty(result),
        left_out=np.array([one.shared[:count] for one in leaving.left_out()]),
        influence=np.array([step[:count] for step in leaving.influence()]),
        aligned=cone_rays(covered, _ALIGNED_RAYS),
    )


def _clusters(places: IntArray) -> Sequence[IntArray]:
    clusters = min(int(places.max()) + 1, _MOST_CLUSTERS)
    if clusters < 2:
        return []
    return [np.flatnonzero(places % clusters == cluster) for cluster in range(clusters)]
