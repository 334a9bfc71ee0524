"""Corners of several cameras on one body -> the rig, and its files."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cubicfish_cli import __version__
from cubicfish_cli.app.listener import SILENT, Listener
from cubicfish_cli.commands.calibration import observed
from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.errors import CorrespondenceError, FitError
from cubicfish_cli.core.files import Content, write_files
from cubicfish_cli.core.fit.model_selection import RefineTarget
from cubicfish_cli.core.frame_names import time_of
from cubicfish_cli.core.geometry import camera_centre, total_sigma
from cubicfish_cli.core.io.calibrated import camera_text
from cubicfish_cli.core.io.camera_yaml import CameraFile
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.tables import read_table
from cubicfish_cli.core.target import Target, target_text
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.wording import quoted
from cubicfish_cli.corners.identification.identified import Detection
from cubicfish_cli.extensions.rigs.faults import find_rig_faults
from cubicfish_cli.extensions.rigs.fit import calibrate as fitting
from cubicfish_cli.extensions.rigs.fit import compare as rig_comparison
from cubicfish_cli.extensions.rigs.fit import evaluate as rig_evaluation
from cubicfish_cli.extensions.rigs.fit.calibrate import PlacedCamera, RigCalibration, RigCamera
from cubicfish_cli.extensions.rigs.fit.clocks import Moving
from cubicfish_cli.extensions.rigs.fit.compare import ComparedCamera
from cubicfish_cli.extensions.rigs.fit.evaluate import RigEvaluation
from cubicfish_cli.extensions.rigs.fit.shots import (
    Shots,
    shots_by_name,
    shots_by_time,
    shots_of_table,
)
from cubicfish_cli.extensions.rigs.rig_yaml import RigFile, RigFileCamera, rig_text

Matching = Literal["name", "time"]
TOLERANCE = 5e-3
"""How far apart photos of one time may be, seconds."""
_NO_ERRORS: Mapping[str, Any] = {
    "rms_px": None,
    "median_px": None,
    "p95_px": None,
    "max_px": None,
    "corners": 0,
    "held_out_rms_px": None,
}
_NAME = re.compile(r"[\w.+-][\w .+-]{0,63}")


def calibrate_rig(
    cameras: Mapping[str, Observations | Detection],
    target: Target | None = None,
    *,
    shots: Matching | Sequence[tuple[str, str, str]] = "name",
    tolerance: float = TOLERANCE,
    times: Mapping[str, Mapping[str, float]] | None = None,
    moving: Mapping[str, Moving] | None = None,
    known: Mapping[str, CameraFile] | None = None,
    hold_lenses: bool = False,
    refine_target: RefineTarget = "auto",
    listener: Listener = SILENT,
) -> RigCalibration:
    """Fit the lenses of several cameras on one body, and how the cameras stand to each other.

    Each camera is calibrated alone first, without any guess; the fields of view need not overlap
    as long as two cameras each see some board of the rigid target in a shot.

    Args:
        cameras: by name, what :func:`detect` found in each one's photos, named corners, or pairs.
            The first camera's frame is the rig's.
        target: the calibration target; pairs need none.
        shots: which photos are of one shot: those of the same ``name`` (without folder and
            ending), those of one ``time``, or rows (shot, camera, photo).
        tolerance: how far apart photos of one time may be, seconds.
        times: by camera and photo, seconds on one clock; by default as photos' names say.
        moving: by camera, how its corners move: clocks that differ are then fitted too.
        known: cameras that are calibrated already; their lenses stay as they are.
        hold_lenses: leave all lenses as each camera alone has them; only places and shots are
            fitted together.
        refine_target: as in :func:`calibrate`.
        listener: who is told how far it is.

    Returns:
        Cameras with camera_from_rig (target's units) and its covariance, errors in pixels, and
        findings.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: a camera cannot be calibrated, no shot connects the cameras, or the shots do
            not fit one rig; one line that says which and what to do.

    """
    names = list(cameras)
    for name in names:
        if not _NAME.fullmatch(name):
            raise FitError(
                f"camera {quoted(name)}: a name may hold letters, digits, spaces and . + - _ (it "
                "becomes a folder's)"
            )
    known = known or {}
    given = [
        RigCamera(
            name=name,
            pairs=observed(own, target),
            camera=known[name].camera if name in known else None,
            fit=known[name].fit if name in known else FitRecord(),
            moving=None if moving is None else moving.get(name),
        )
        for name, own in cameras.items()
    ]
    return fitting.calibrate_rig(
        given,
        _matched(names, [one.pairs.images for one in given], shots, tolerance, times or {}),
        target=target,
        refine_target=refine_target,
        hold_lenses=hold_lenses,
        diagnose=find_rig_faults,
        progress=listener.stages("Fitting"),
    )


def load_shots(
    path: Path,
) -> tuple[list[tuple[str, str, str]] | None, dict[str, dict[str, float]] | None]:
    """Which photos are of one shot, by a table: rows or else times for :func:`calibrate_rig`.

    Args:
        path: a CSV file with the columns ``shot,camera,image``, or ``camera,image,time`` (seconds).

    Raises:
        CorrespondenceError: it is none.

    """
    table = read_table(
        path,
        required=("camera", "image"),
        optional=("shot", "time"),
        error=CorrespondenceError,
    )
    columns = table.columns
    if "shot" in columns:
        return list(zip(columns["shot"], columns["camera"], columns["image"], strict=True)), None
    if "time" not in columns:
        raise CorrespondenceError(f"{path} has neither a column shot nor a column time: add one")
    times: dict[str, dict[str, float]] = {}
    seconds = table.floats("time").tolist()
    for camera, image, time in zip(columns["camera"], columns["image"], seconds, strict=True):
        times.setdefault(camera, {})[image] = time
    return None, times


def _matched(
    names: Sequence[str],
    photos: Sequence[Sequence[str]],
    shots: Matching | Sequence[tuple[str, str, str]],
    tolerance: float,
    times: Mapping[str, Mapping[str, float]],
) -> Shots:
    if shots == "name":
        return shots_by_name(names, photos)
    if shots == "time":
        return shots_by_time(
            names,
            photos,
            [
                times[name] if name in times else _times_of_names(own)
                for name, own in zip(names, photos, strict=True)
            ],
            tolerance,
        )
    if isinstance(shots, str):
        raise FitError(f"shots {quoted(shots)} is not known: use 'name', 'time', or rows")
    return shots_of_table(names, photos, shots)


def _times_of_names(photos: Sequence[str]) -> dict[str, float]:
    found = ((photo, time_of(photo)) for photo in photos)
    return {photo: time for photo, time in found if time is not None}


def rig_record(rig: RigCalibration) -> dict[str, Any]:
    """Plain data of a rig: what rig.yaml holds but for version and provenance."""
    return {
        "units": rig.units,
        "cameras": [
            _camera_record(
                one,
                f"{one.name}/camera.yaml",
                one.covariance,
                {
                    **one.errors.as_record(),
                    "images": one.fit.images,
                    "held_out_rms_px": one.held_out_rms_px,
                    "alone_rms_px": one.alone_rms_px,
                    "late_ms": None if one.late_s is None else 1e3 * one.late_s,
                    "late_sigma_ms": None if one.late_sigma_s is None else 1e3 * one.late_sigma_s,
                },
            )
            for one in rig.cameras
        ],
        "pairs": [one.as_record() for one in rig.pairs],
        "fit": {
            **rig.errors.as_record(),
            "held_out_rms_px": rig.held_out_rms_px,
            "shots": len(rig.shots),
            "refine_target": rig.refined,
            "held_lenses": rig.held_lenses,
            "findings": [one.as_record() for one in rig.findings],
            "per_shot": [
                {
                    **record,
                    "rig_from_world": {
                        "rotation_vector": vector.tolist(),
                        "translation": shift.tolist(),
                    },
                }
                for record, vector, shift in zip(
                    rig.per_shot, rig.poses.rotation_vector, rig.poses.translation, strict=True
                )
            ],
        },
    }


def _camera_record(
    camera: PlacedCamera | RigFileCamera,
    path: str,
    covariance: FloatArray | None,
    fit: Mapping[str, Any],
) -> dict[str, Any]:
    spread = np.zeros((6, 6)) if covariance is None else covariance
    return {
        "name": camera.name,
        "camera": path,
        "camera_from_rig": {
            "rotation": camera.rotation.tolist(),
            "translation": camera.translation.tolist(),
        },
        "position": camera_centre(camera.rotation, camera.translation).tolist(),
        "covariance": None if covariance is None else covariance.tolist(),
        "turn_sigma_deg": float(np.rad2deg(total_sigma(spread[:3, :3]))),
        "shift_sigma": total_sigma(spread[3:, 3:]),
        "fit": dict(fit),
    }


def save_rig(
    folder: str | os.PathLike[str],
    rig: RigCalibration,
    *,
    made_by: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> list[Path]:
    """Write ``rig.yaml``, each camera's ``camera.yaml`` in a folder of its name, and the target.

    Args:
        folder: where.
        rig: the rig.
        made_by: plain data on where it comes from; the version is added.
        overwrite: whether existing files may be replaced.

    Returns:
        The files, all written together or none; ``target.refined.yaml`` where it was fitted.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, or it cannot be written.

    """
    origin = {"version": __version__, **(made_by or {})}
    texts: dict[Path, Content] = {
        Path(folder) / "rig.yaml": rig_text({**rig_record(rig), "made_by": origin})
    }
    for one in rig.cameras:
        texts[Path(folder) / one.name / "camera.yaml"] = camera_text(
            one.camera, fit=one.fit, made_by={"title": one.name, **origin}
        )
    if rig.target is not None and rig.refined != "off":
        texts[Path(folder) / "target.refined.yaml"] = target_text(rig.target)
    return write_files(texts, overwrite=overwrite)


def evaluate_rig(
    rig: RigFile,
    cameras: Mapping[str, Observations | Detection],
    target: Target | None = None,
    *,
    shots: Matching | Sequence[tuple[str, str, str]] = "name",
    tolerance: float = TOLERANCE,
    times: Mapping[str, Mapping[str, float]] | None = None,
) -> RigEvaluation:
    """Measure a known rig on other shots: where it was is fitted, nothing else.

    Args:
        rig: as ``load_rig`` gives it.
        cameras: by the rig's names, as for :func:`calibrate_rig`.
        target: the calibration target, in the rig's units; pairs need none.
        shots: as for :func:`calibrate_rig`.
        tolerance: likewise.
        times: likewise.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: the rig has no such camera, or other units than the target; photos are of
            another size, or cannot be placed.

    """
    known = {one.name: one for one in rig.cameras}
    for name in cameras:
        if name not in known:
            raise FitError(
                f"the rig has no camera {quoted(name)}: its cameras are {', '.join(known)}"
            )
    if target is not None and rig.units is not None and target.units != rig.units:
        raise FitError(
            f"the rig's lengths are in {rig.units} and the target's in {target.units}: write the "
            "target in the rig's units"
        )
    pairs = [observed(own, target) for own in cameras.values()]
    names = list(cameras)
    return rig_evaluation.evaluate_rig(
        [known[name] for name in names],
        pairs,
        _matched(names, [one.images for one in pairs], shots, tolerance, times or {}),
    )


def compare_rigs(first: RigFile, second: RigFile) -> list[ComparedCamera]:
    """How far apart the cameras of two rigs stand, and their lenses are.

    Args:
        first: one rig.
        second: another one, whose cameras have the same names.

    Raises:
        FitError: the rigs have fewer than two cameras in common, or other units.

    """
    if first.units != second.units:
        raise FitError(
            f"one rig's lengths are in {first.units} and the other's in {second.units}: calibrate "
            "both with targets of one unit"
        )
    return rig_comparison.compare_rigs(first.cameras, second.cameras)


def loaded_record(rig: RigFile) -> dict[str, Any]:
    """The same plain data of a rig that was read from its file, whatever the file left out."""
    unknown = {**_NO_ERRORS, "images": 0, "alone_rms_px": None}
    cameras = [
        _camera_record(one, one.path, one.covariance, {**unknown, **one.fit}) for one in rig.cameras
    ]
    return {
        "units": rig.units,
        "cameras": cameras,
        "pairs": [{"cameras": [], "shots": 0, "rms_px": None, **one} for one in rig.pairs],
        "fit": {**_NO_ERRORS, "shots": 0, **rig.fit},
    }
