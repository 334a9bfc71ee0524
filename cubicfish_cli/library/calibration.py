"""Corners -> camera, and what a camera is worth."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Corners, Correspondences
from cubicfish_cli.errors import CameraFileError, CorrespondenceError, FitError
from cubicfish_cli.fitting import calibrate as fitting
from cubicfish_cli.fitting import evaluate as evaluation
from cubicfish_cli.fitting.calibrate import Calibration, RefineTarget
from cubicfish_cli.fitting.evaluate import Evaluation
from cubicfish_cli.fitting.stages import Progress
from cubicfish_cli.fitting.uncertainty import sigma_at
from cubicfish_cli.fitting.verdict import Verdict, verdict
from cubicfish_cli.formats.camera_yaml import CameraFile
from cubicfish_cli.library.pairs import pairs_of
from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.naming.detect import Detection
from cubicfish_cli.target import Target
from cubicfish_cli.wording import did_you_mean, quoted

FloatArray = npt.NDArray[np.float64]


def calibrate(
    corners: Correspondences | Corners | Detection,
    target: Target | None = None,
    *,
    refine_target: RefineTarget = "auto",
    hold_out: bool = True,
    progress: Progress | None = None,
) -> Calibration:
    """Fit a camera, the pose of every photo and, where photos gain by it, the object.

    The fit of ``cubicfish calibrate``. Poses are ``camera_from_world``,
    rotation matrices (M, 3, 3) and translations (M, 3) in the unit of the world points; errors are
    in pixels.

    Args:
        corners: what :func:`detect` found, named corners of any detector, or 2D-3D pairs.
        target: the object that the corners are of; pairs need none, and then the object is taken
            as it is.
        refine_target: what of the object is fitted too: ``off``, ``shape`` (boards bend, twist,
            stretch and move a little), ``points`` (each corner has an offset of its own as
            well), or ``auto``: the richest of these that lowers the held-out error, and ``off``
            where it is not certain of any corner which it is.
        hold_out: also measure the error on photos left out of the fit (five more fits a level);
            ``auto`` needs it.
        progress: called with what is done now, in words, and the share done, 0 to 1.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: the corners are too few, or do not determine a lens; where a likely cause is
            found, the text says it.

    """
    if refine_target not in get_args(RefineTarget):
        raise FitError(
            f"refine_target {quoted(refine_target)} is not known: "
            f"{did_you_mean(str(refine_target), get_args(RefineTarget))}"
        )
    pairs = pairs_of(corners, target)
    known = corners.findings if isinstance(corners, Detection) else ()
    return fitting.calibrate(
        pairs,
        target=target,
        refine_target=refine_target,
        hold_out=hold_out,
        known=known,
        progress=progress,
    )


def evaluate(
    camera: CubicCamera,
    corners: Correspondences | Corners | Detection,
    target: Target | None = None,
) -> Evaluation:
    """Measure a camera on other photos: their poses are fitted, the camera stays as it is.

    Args:
        camera: the camera.
        corners: as in :func:`calibrate`; no corner is dropped.
        target: the object that the corners are of; pairs need none.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: the photos are of another size than the camera's, none of them can be placed,
            or no corner lies in the camera's field.

    """
    return evaluation.evaluate(camera, pairs_of(corners, target))


def judge(calibrated: Calibration | CameraFile) -> Verdict:
    """Say in words what a calibration is worth: the verdict that ``cubicfish calibrate`` prints.

    Args:
        calibrated: a fit, or what :func:`load_camera` read, with errors in pixels.

    """
    camera = calibrated.camera
    return verdict(_fit_of(calibrated), camera.image_size, camera.outline())


def uncertainty(calibrated: Calibration | CameraFile, pixel: npt.ArrayLike) -> FloatArray:
    """How far the camera itself may be off: sqrt(var x + var y) of a distant point's pixel.

    That is how far the pixel would move if the same photos were taken again with other noise. It
    is interpolated on the grid over the photo that the fit left.

    Args:
        calibrated: a fit, or what :func:`load_camera` read.
        pixel: (..., 2) x, y.

    Returns:
        (...,) pixels; NaN outside the photo and the camera's field.

    Raises:
        CameraFileError: the file does not say.
        CorrespondenceError: ``pixel`` has another shape.

    """
    pixel = np.asarray(pixel, float)
    if not pixel.ndim or pixel.shape[-1] != 2:
        raise CorrespondenceError(f"pixel has the shape {pixel.shape}, not (..., 2)")
    flat = pixel.reshape(-1, 2)
    camera = calibrated.camera
    in_photo = ((flat >= -0.5) & (flat <= np.array(camera.image_size) - 0.5)).all(axis=1)
    index = np.flatnonzero(in_photo)
    seen = index[np.isfinite(camera.unproject(flat[index])[:, 0])]
    sigma = np.full(len(flat), np.nan)
    try:
        sigma[seen] = sigma_at(_fit_of(calibrated)["uncertainty"], flat[seen])
    except (KeyError, TypeError, ValueError, IndexError) as problem:
        raise CameraFileError(
            "this camera's file does not say how certain it is: calibrate again"
        ) from problem
    return sigma.reshape(pixel.shape[:-1])


def _fit_of(calibrated: Calibration | CameraFile) -> dict[str, Any]:
    if isinstance(calibrated, Calibration):
        return calibrated.as_record()
    return dict(calibrated.fit)
