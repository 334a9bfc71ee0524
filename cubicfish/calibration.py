"""Fitting a camera to corners, measuring it on others, and saving it."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.errors import CameraFileError, CorrespondenceError, FitError
from cubicfish.files.whole_files import write_files
from cubicfish.find.identification.identified import Detection
from cubicfish.fit import calibrate as fitting
from cubicfish.fit.calibration import Calibration
from cubicfish.fit.model_selection import RefineTarget
from cubicfish.io.camera_yaml import Calibrated, CameraFile
from cubicfish.judge.finding import Finding
from cubicfish.listener import Listener
from cubicfish.models.cubic import CubicCamera
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.wording import did_you_mean, quoted

if TYPE_CHECKING:
    from cubicfish.fit.evaluate import Evaluation


def observed(given: Observations | Detection, target: Target | None) -> Observations:
    """Check what a caller fits a camera to, and give it world points: of ``target``, if given.

    Raises:
        CorrespondenceError: corners come without their target, do not fit it, or hold impossible
            arrays; one line that says which.

    """
    seen = given.corners if isinstance(given, Detection) else given
    if not isinstance(seen, Observations):
        raise CorrespondenceError(
            f"{type(seen).__name__} is neither Observations nor a Detection: "
            "Observations.from_points makes them of arrays"
        )
    return seen.checked(target)


def _placed(pairs: Observations) -> tuple[Observations, list[Finding]]:
    """The same corners, with the places of boards that their target does not know."""
    target = pairs.target
    if target is None or not target.unplaced:
        return pairs, []
    from cubicfish.observe.places import told_of_places, with_places  # for such targets alone

    placed = with_places(pairs, target)
    seen = {pairs.boards[index] for index in set(pairs.board.tolist())}
    return pairs.with_target(placed), told_of_places(target, placed, seen)


def calibrate(
    corners: Observations | Detection,
    target: Target | None = None,
    *,
    refine_target: RefineTarget = "auto",
    hold_out: bool = True,
    goal_px: float | None = None,
    listener: Listener = Listener(),
) -> Calibration:
    """Fit a camera, the pose of every photo and, where photos gain by it, the target.

    The fit of ``cubicfish calibrate``. Poses are ``camera_from_world``,
    rotation matrices (M, 3, 3) and translations (M, 3) in the unit of the world points; errors are
    in pixels.

    Args:
        corners: what :func:`detect` found, named corners of any detector, or 2D-3D pairs.
        target: the calibration target that the corners are of; those of :func:`detect` and
            :func:`load_corners` bring their own. Pairs need none, and then the target is taken
            as it is.
        refine_target: what of the target to fit too: ``off``, ``shape`` (boards bend, twist,
            stretch and move a little), ``points`` (each corner has an offset of its own as
            well), or ``auto``: the richest of these that lowers the held-out error, and ``off``
            if no corner's name is certain.
        hold_out: also measure the error on photos left out of the fit (five more fits per level);
            ``auto`` needs it.
        goal_px: the uncertainty wanted over 95 % of the field, pixels, by which the verdict goes
            then; by default what docs/expectations.md says.
        listener: is told of progress and findings.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: the corners are too few, or do not determine a lens; the text names a likely
            cause if one is found; or the goal is not above 0.

    """
    if goal_px is not None and not 0 < goal_px < math.inf:
        raise FitError(f"goal_px is {goal_px}, which is not an uncertainty in pixels above 0")
    if refine_target not in get_args(RefineTarget):
        raise FitError(
            f"refine_target {quoted(refine_target)} is not known: "
            f"{did_you_mean(str(refine_target), get_args(RefineTarget))}"
        )
    pairs, told = _placed(observed(corners, target))
    known = [*(corners.findings if isinstance(corners, Detection) else ()), *told]
    return fitting.calibrate(
        pairs,
        target=pairs.target,
        refine_target=refine_target,
        hold_out=hold_out,
        goal_px=goal_px,
        diagnose=partial(find_faults, known=known),
        progress=listener.stages("Fitting"),
    )


def evaluate(
    camera: CubicCamera,
    corners: Observations | Detection,
    target: Target | None = None,
) -> Evaluation:
    """Measure a camera on other photos: fit their poses, and keep the camera as it is.

    Args:
        camera: the camera.
        corners: as in :func:`calibrate`; no corner is dropped.
        target: the calibration target that the corners are of, as in :func:`calibrate`.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: the photos are of another size than the camera's, none of them can be placed,
            or no corner lies in the camera's field.

    """
    from cubicfish.fit.evaluate import evaluate as measure  # for this alone

    return measure(camera, _placed(observed(corners, target))[0])


def save_camera(
    path: str | os.PathLike[str],
    camera: Calibrated | CubicCamera,
    *,
    made_by: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write ``camera.yaml``, which :func:`load_camera` and every command read.

    Args:
        path: the file.
        camera: a fit, whose errors in pixels and poses go into the file too, or a camera alone.
        made_by: plain data on its origin; the version is added.
        overwrite: whether an existing file may be replaced.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.
        CameraFileError: ``made_by`` is not plain data, or ``camera`` is no camera.

    """
    if isinstance(camera, CubicCamera):
        camera = CameraFile(camera=camera)
    if not isinstance(camera, Calibrated):
        raise CameraFileError(f"{type(camera).__name__} is no camera that can be saved")
    camera.save(path, made_by=made_by, overwrite=overwrite)


def save_target(path: str | os.PathLike[str], target: Target, *, overwrite: bool = False) -> None:
    """Write a target, such as one that a calibration refined, as ``target.yaml``.

    Lengths are in the target's own unit.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    write_files({Path(path): target.text()}, overwrite=overwrite)
