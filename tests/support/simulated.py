"""Corners without pictures: what a finder would hand over, with errors like those of real photos.

Rendering and finding corners takes a second per photo; this takes milliseconds::

    from synthetic_lenses import synthetic_lens
    from simulated import CornerErrors, simulated_corners

    lens = synthetic_lens("moving-pupil")                 # or any lens with project and unproject
    corners, truth = simulated_corners(lens, target, 15, seed=3)
    pairs = correspondences.pair(corners, target)       # and then fitting.calibrate as ever
    aligned_difference(camera, truth.lens, rays)        # truth.lens is a lens of rays

The default errors are not independent, since real ones are not: within a photo they share what
blur and light do (``shared``, smooth over the picture), and photos differ in how bad they are
(``spread``). ``CornerErrors(noise=0.1, shared=0, spread=0)`` is the textbook's noise, under which
every error bar looks right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from synthetic_lenses import SyntheticLens

from cubicfish import Observations, Target
from cubicfish.scene.photos import chosen_poses
from cubicfish.scene.truth import AnyLens, Pose, project_corners
from cubicfish.scene.views import WholeLens

FloatArray = npt.NDArray[np.float64]

_WAVES = 48


@dataclass(frozen=True, kw_only=True)
class CornerErrors:
    """How found corners miss the true ones.

    Attributes:
        noise: standard deviation along x and y of each corner's own error, pixels.
        shared: the same of the error that neighbouring corners of one photo share, pixels.
        width: over what share of the photo's shorter side the shared error changes.
        spread: standard deviation of the logarithm of each photo's factor on both errors; 0.5 is
            a sharp photo and one three times as bad.

    """

    noise: float = 0.05
    shared: float = 0.05
    width: float = 0.15
    spread: float = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """What simulated corners were made from.

    Attributes:
        poses: camera_from_world of each photo.
        pixel: (N, 2) where each corner really is.
        factor: (photos,) of each photo on its errors.
        lens: the lens for rays; of one that is not central, the nearest that is.

    """

    poses: tuple[Pose, ...]
    pixel: FloatArray
    factor: FloatArray
    lens: AnyLens


def simulated_corners(
    lens: WholeLens,
    target: Target,
    n_photos: int,
    *,
    seed: int = 0,
    errors: CornerErrors = CornerErrors(),
    image_size: tuple[int, int] | None = None,
    poses: tuple[Pose, ...] | None = None,
) -> tuple[Observations, Truth]:
    """Corners of photos that fill the field, and the truth behind them.

    Args:
        lens: the true lens.
        target: the object as it really is; hand another to the fit to see what that does.
        n_photos: how many photos.
        seed: of poses and errors; the same seed gives the same corners.
        errors: how corners miss.
        image_size: (width, height) in pixels, where the lens does not say.
        poses: take the photos from these poses and not from chosen ones.

    Raises:
        TargetError: the object cannot be drawn, or cannot be seen so often.

    """
    size = image_size or lens.image_size  # type: ignore[attr-defined]
    if poses is None:
        poses = tuple(chosen_poses(target, lens, size, n_photos, seed=seed))
    rng = np.random.default_rng((seed, 1))
    factor = np.exp(errors.spread * rng.standard_normal(len(poses)))
    seen = [project_corners(target, lens, pose, size) for pose in poses]
    pixel, found = [], []
    for one, scale in zip(seen, factor, strict=True):
        true = one.pixel[one.visible]
        own = errors.noise * rng.standard_normal(true.shape)
        both = errors.shared * smooth_errors(true, errors.width * min(size), rng)
        pixel.append(true)
        found.append(true + scale * (own + both))
    corners = Observations.from_corners(
        [np.column_stack([one.board, one.column, one.row])[one.visible] for one in seen],
        found,
        size,
        boards=[board.name for board in target.boards],
        images=[f"photo_{number:03d}" for number in range(1, len(poses) + 1)],
    )
    return corners, Truth(
        poses=poses,
        pixel=np.concatenate(pixel),
        factor=factor,
        lens=lens.far if isinstance(lens, SyntheticLens) else lens,
    )


def smooth_errors(pixel: FloatArray, width: float, rng: np.random.Generator) -> FloatArray:
    """A random smooth field at pixels (N, 2) -> (N, 2), of variance 1 along x and along y.

    Random waves (Rahimi and Recht 2007), correlated as a Gaussian of standard deviation ``width``.
    """
    field = []
    for _ in range(2):
        wave = rng.standard_normal((2, _WAVES)) / width
        phase = rng.uniform(0, 2 * np.pi, _WAVES)
        field.append(np.cos(pixel @ wave + phase).sum(axis=1) * np.sqrt(2 / _WAVES))
    return np.stack(field, axis=-1)
