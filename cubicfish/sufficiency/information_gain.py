"""The information gain of each of many photos, for a camera that is not fitted yet.

A radial lens and all poses are fitted once. The camera's unknown difference from that lens is
modelled as a smooth field of pixels over the picture: polynomials, as free as a lens may be. A
photo's corners, its own pose eliminated, bring information on that field, and photos' information
adds up. A common turn of all photos does not count, since no photo can measure it.
"""

from collections.abc import Sequence

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.models.radial import RadialCamera, project_jacobian
from cubicfish.solve.poses import cross_matrix
from cubicfish.solve.statistics import noise_px
from cubicfish.solve.subset import middle, world_scale
from cubicfish.sufficiency.sufficiency import default_goal
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray

# How free the field is: polynomials up to this degree, of so many pixels' spread each for every
# 1000 pixels of the photo's longer side.
_DEGREE = 5
_SPREAD = 3.0
# No corner is surer than this share of the longer side, nor a photo that hardly adds of use.
_LEAST_NOISE = 5e-5
_GRID = (12, 9)
# A pose has six unknowns.
_FEWEST_CORNERS = 4


class InformationGain:
    """The information gain of photos beside those taken: the fall of the uncertainty's logarithm.

    Photos are known by their places among ``names``.
    """

    def __init__(self, pairs: Observations, names: Sequence[str], quality: FloatArray) -> None:
        """Fit a lens to all photos.

        Args:
            pairs: their corners.
            names: of all photos, those without corners among them.
            quality: (N,) how much the corners of each weigh, 0 to 1.

        Raises:
            FitError: they do not determine a lens.

        """
        pairs = pairs.with_world((pairs.world - middle(pairs)) / world_scale(pairs))
        try:
            reference = fit_radial(pairs, thorough=False)
        except np.linalg.LinAlgError as failure:
            raise FitError("the photos do not determine a lens") from failure
        longer = max(pairs.image_size)
        noise = max(noise_px(reference.residual), _LEAST_NOISE * longer)
        used = reference.pairs
        points = reference.poses.apply(used.image, used.world)
        grid = _find_seen_cells(used)
        ray = reference.camera.unproject(grid)
        grid, ray = grid[np.isfinite(ray[:, 0])], ray[np.isfinite(ray[:, 0])]
        if not len(grid):
            raise FitError("the photos do not determine a lens")
        self._goal = default_goal(pairs.image_size)
        self._to_basis = _make_orthonormal(_compute_polynomials(grid, pairs.image_size))
        self._field = _take_out_turns(
            _split_by_axes(_compute_polynomials(grid, pairs.image_size) @ self._to_basis),
            reference.camera,
            ray,
        )
        spread = _SPREAD * longer / 1000
        self._known = np.eye(self._field.shape[1]) / spread**2
        number_of = {name: number for number, name in enumerate(names)}
        self._information: dict[int, FloatArray] = {}
        for own, name in enumerate(used.images):
            rows = used.image == own
            if rows.sum() < _FEWEST_CORNERS:
                continue
            _, by_point, _ = project_jacobian(reference.camera.parameters, points[rows])
            by_field = _split_by_axes(
                _compute_polynomials(used.pixel[rows], pairs.image_size) @ self._to_basis
            )
            information = _compute_information(by_field, by_point, points[rows])
            number = number_of[name]
            self._information[number] = information * quality[number] / noise**2
        self._now = self._average_log_variance(self._known)

    def of(self, photo: int) -> float:
        """Return what a photo adds to those taken; 0 if it does not fit the common lens."""
        information = self._information.get(photo)
        if information is None:
            return 0.0
        return float(self._now - self._average_log_variance(self._known + information)) / 2

    def share(self, gain: float) -> float:
        """Return which share of what is wanted a gain is, given those that are taken now.

        Above the goal that is the fall of the uncertainty in goals; below, where it falls ever
        less, the information added, as a share of what the goal takes.
        """
        before = float(np.exp(self._now / 2)) / self._goal
        after = before * float(np.exp(-gain))
        return max(before - after, (after**-2 - before**-2) / 2)

    def take(self, photo: int) -> None:
        """Take a photo."""
        information = self._information.get(photo)
        if information is not None:
            self._known = self._known + information
            self._now = self._average_log_variance(self._known)

    def _average_log_variance(self, known: FloatArray) -> float:
        """Return the mean over the field of the logarithm of a pixel's variance."""
        half = np.linalg.solve(np.linalg.cholesky(known), self._field.T)
        variance = (half * half).sum(axis=0).reshape(-1, 2).sum(axis=1)
        return float(np.log(variance).mean())


def _compute_information(
    by_field: FloatArray, by_point: FloatArray, points: FloatArray
) -> FloatArray:
    """Return the information (K, K) of a photo's corners (N,) on the field, for a noise of 1."""
    by_pose = np.concatenate([-by_point @ cross_matrix(points), by_point], axis=2).reshape(-1, 6)
    scale = np.linalg.norm(by_pose, axis=0)
    axes, size, _ = np.linalg.svd(by_pose / np.where(scale > 0, scale, 1.0), full_matrices=False)
    axes = axes[:, size > 1e-9 * size[0]]
    free = by_field - axes @ (axes.T @ by_field)
    return np.asarray(free.T @ free)


def _find_seen_cells(pairs: Observations) -> FloatArray:
    """Return middles (G, 2) of the parts of the picture that have corners, pixels."""
    size, parts = np.array(pairs.image_size), np.array(_GRID)
    place = np.clip(((pairs.pixel + 0.5) / size * parts).astype(int), 0, parts - 1)
    return np.asarray((np.unique(place, axis=0) + 0.5) / parts * size - 0.5)


def _compute_polynomials(pixel: FloatArray, image_size: tuple[int, int]) -> FloatArray:
    """Return (N, K) products of Legendre polynomials of x and y up to the degree."""
    longer = max(image_size)
    x, y = (2 * (pixel - (np.array(image_size) - 1) / 2) / longer).T
    of_x, of_y = (np.polynomial.legendre.legvander(one, _DEGREE) for one in (x, y))
    return np.stack(
        [of_x[:, i] * of_y[:, j] for i in range(_DEGREE + 1) for j in range(_DEGREE + 1 - i)],
        axis=-1,
    )


def _make_orthonormal(values: FloatArray) -> FloatArray:
    """Return (K, L): combinations of functions at points (G, K) that are orthonormal there."""
    _, size, axes = np.linalg.svd(values / np.sqrt(len(values)), full_matrices=False)
    kept = size > 1e-3 * size[0]
    return np.asarray(axes[kept].T / size[kept])


def _split_by_axes(values: FloatArray) -> FloatArray:
    """Fields of x and of y: (N, L) -> (2N, 2L), rows x and y in turn."""
    return np.asarray(np.kron(values, np.eye(2)))


def _take_out_turns(field: FloatArray, camera: RadialCamera, ray: FloatArray) -> FloatArray:
    """Fields (2G, K) at rays (G, 3), less what a small turn of the camera does."""
    _, by_ray, _ = project_jacobian(camera.parameters, ray)
    turns = (-by_ray @ cross_matrix(ray)).reshape(-1, 3)
    axes, _ = np.linalg.qr(turns)
    return np.asarray(field - axes @ (axes.T @ field))
