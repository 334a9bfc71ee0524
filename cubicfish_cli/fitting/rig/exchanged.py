"""Photos that were taken with another camera of the rig than they are said to be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.robust import noise_px
from cubicfish_cli.model.cubic import CubicCamera

# Photos fit another lens so many times better before they are said to be its.
_TIMES = 2.0


class Known(Protocol):
    """A camera of a rig, calibrated or not."""

    @property
    def name(self) -> str:
        """Of the camera."""

    @property
    def pairs(self) -> Correspondences:
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
    errors = np.array([[_error(photos, lens) for lens in known] for photos in known])
    for a in range(len(known)):
        for b in range(a + 1, len(known)):
            if errors[a, a] > _TIMES * errors[a, b] and errors[b, b] > _TIMES * errors[b, a]:
                raise FitError(
                    f"cameras {known[a].name} and {known[b].name} are exchanged: the photos of "
                    f"each fit the lens of the other ({errors[a, b]:.2g} px where their own is "
                    f"off by {errors[a, a]:.2g} px): exchange their folders"
                )


def _error(photos: Known, lens: Known) -> float:
    """Noise of the photos' corners under a lens, their poses fitted, pixels."""
    camera, pairs = lens.camera, photos.pairs
    if camera is None or camera.image_size != pairs.image_size:
        return np.inf
    fit, _, _ = fit_poses(camera.radial, pairs)
    return np.inf if fit is None else noise_px(fit.residual)
