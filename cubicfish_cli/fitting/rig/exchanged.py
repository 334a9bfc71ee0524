"""Photos that were taken with another camera of the rig than they are said to be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.adjustment import adjust
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.lenses import FixedLens
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.robust import huber_px, noise_px
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import BoolArray, FloatArray

# Photos fit another lens so many times better before they are said to be its.
_TIMES = 2.0
# A shot's cameras are exchanged where they stand so many times nearer the other way round, and
# then as near as usual, within so many times.
_CLEARLY, _LIKE = 10.0, 5.0
_SEEDS, _FAR = 40, 0.5


class Known(Protocol):
    """A camera of a rig, calibrated or not."""

    @property
    def name(self) -> str:
        """Of the camera."""

    @property
    def pairs(self) -> Observations:
        """Of its photos."""

    @property
    def camera(self) -> CubicCamera | None:
        """Its lens, where that is known."""


def refuse_exchanged(cameras: Sequence[Known]) -> None:
    """Refuse photos that are of another size than their lens, or fit another one far better.

    Raises:
        FitError: they do; the text names the cameras.

    """
    known = [camera for camera in cameras if camera.camera is not None]
    for one in known:
        assert one.camera is not None
        if one.camera.image_size != one.pairs.image_size:
            raise FitError(
                "camera {}: its photos have {}x{} pixels and its lens is of {}x{}: check that no "
                "two cameras are exchanged".format(
                    one.name, *one.pairs.image_size, *one.camera.image_size
                )
            )
    errors = np.array([[_error(photos, lens) for lens in known] for photos in cameras])
    own = [cameras.index(camera) for camera in known]
    for b, lens in enumerate(known):
        mine = errors[own[b], b]
        for a, other in enumerate(cameras):
            # Of a camera whose lens is not known it is enough that its photos fit this one.
            theirs = errors[a, own.index(a)] if a in own else np.inf
            back = errors[own[b], own.index(a)] if a in own else 0.0
            if a != own[b] and mine > _TIMES * errors[a, b] and theirs > _TIMES * back:
                raise FitError(
                    f"cameras {lens.name} and {other.name} are exchanged: the photos of "
                    f"{other.name} fit the lens of {lens.name} ({errors[a, b]:.2g} px where its "
                    f"own are off by {mine:.2g} px): exchange their folders"
                )


def _error(photos: Known, lens: Known) -> float:
    """Noise of the photos' corners under a lens, their poses fitted, pixels."""
    camera, pairs = lens.camera, photos.pairs
    if camera is None or camera.image_size != pairs.image_size:
        return np.inf
    # Cameras of one make differ by little more than their radial references miss.
    placed, own, _ = fit_poses(camera.radial, pairs)
    if placed is None:
        return np.inf
    limit = huber_px(placed.residual)
    return noise_px(adjust(FixedLens(camera=camera), placed.poses, own, huber_px=limit).residual)


def exchanged_shots(relative: Poses) -> BoolArray:
    """Shots (S,) in which two cameras' photos were exchanged, as far as their places tell.

    What one camera says of the other is then the other way round. Where that is nearly the same,
    as of two cameras back to back, it does not show.

    Args:
        relative: second_from_first of each shot, with lengths about those of the target as 1.

    """
    count = len(relative)
    back = relative.inverse()
    seeds = np.unique(np.linspace(0, count - 1, min(count, _SEEDS)).astype(int))
    apart = [(_apart(relative, relative, seed), _apart(back, relative, seed)) for seed in seeds]
    cost = [float(np.minimum(np.minimum(*pair), _FAR).sum()) for pair in apart]
    as_is, turned = apart[int(np.argmin(cost))]
    usual = float(np.median(np.minimum(as_is, turned)))
    found = (as_is > _CLEARLY * turned) & (turned < _LIKE * usual)
    straight = (turned > _CLEARLY * as_is) & (as_is < _LIKE * usual)
    return np.asarray(found if found.sum() <= straight.sum() else straight)


def _apart(poses: Poses, others: Poses, seed: int) -> FloatArray:
    """(S,) how far poses are from one of others: radians, and lengths."""
    turn = Rotation.from_matrix(poses.rotation) * Rotation.from_matrix(others.rotation[seed]).inv()
    shift = np.linalg.norm(poses.translation - others.translation[seed], axis=1)
    return np.asarray(turn.magnitude() + shift)
