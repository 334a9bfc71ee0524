"""What cameras and rigs in files are, and how far apart two of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.assess.camera_facts import CameraFacts
from cubicfish_cli.assess.verdict import Verdict, rig_verdict
from cubicfish_cli.files import refuse_existing
from cubicfish_cli.fitting.comparison import Comparison, compare
from cubicfish_cli.fitting.rig.compare import ComparedCamera as ComparedPlace
from cubicfish_cli.formats.camera_yaml import load_any_camera, load_camera
from cubicfish_cli.formats.rig_yaml import load_rig
from cubicfish_cli.library.asked import (
    RUN,
    Run,
    StrPath,
    in_folder,
    path_or_none,
    rig_file_in,
    rig_in,
)
from cubicfish_cli.library.rigs import compare_rigs, loaded_record
from cubicfish_cli.rendering.difference_picture import difference_picture
from cubicfish_cli.undistortion.images import check_suffix, write_picture

_DRAWN_PIXELS = 150_000


@dataclass(frozen=True, kw_only=True)
class CameraInfo:
    """What the file of a camera or a rig says.

    Attributes:
        model: the file.
        verdict: what the camera or the rig is worth; None of a camera that was not fitted.
        facts: the camera in the figures that people ask for first; None of a rig.
        rig: the rig's plain data: units, cameras, pairs, fit and made_by; None of a camera.

    """

    model: Path
    verdict: Verdict | None
    facts: CameraFacts | None = None
    rig: dict[str, Any] | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish info --json`` prints."""
        known = {"rig": self.rig} if self.facts is None else self.facts.as_record()
        return {"model": self.model, **known}


def info_files(calibration: StrPath) -> CameraInfo:
    """Say what a camera or a rig is, as ``cubicfish info`` does.

    Args:
        calibration: its file, or the folder of that.

    Raises:
        CameraFileError: the file cannot be used.

    """
    rig = rig_in(Path(calibration))
    if rig is not None:
        known = load_rig(rig)
        record = {**loaded_record(known), "made_by": dict(known.made_by)}
        return CameraInfo(model=rig, verdict=rig_verdict(record), rig=record)
    path = in_folder(Path(calibration))
    facts = load_any_camera(path).facts
    return CameraInfo(model=path, verdict=facts.verdict, facts=facts)


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedFiles:
    """What became of :func:`compare_files`.

    Attributes:
        comparison: how far apart the cameras are.
        picture: the picture of that; None where none was asked for.

    """

    comparison: Comparison
    picture: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish compare --json`` prints."""
        drawn = {} if self.picture is None else {"picture": self.picture}
        return {**self.comparison.as_record(), **drawn}


def compare_files(
    first: StrPath, second: StrPath, *, picture: StrPath | None = None, run: Run = RUN
) -> ComparedFiles:
    """Say how far apart two cameras see the same rays, as ``cubicfish compare`` does.

    Args:
        first: the file of a camera, or the folder of that; differences are in its pixels.
        second: another one.
        picture: also draws the difference at every pixel of the first camera.
        run: how the work is done.

    Raises:
        CameraFileError: a file cannot be used.
        FitError: the cameras have no field in common.
        OutputError: the picture exists and may not be replaced, or cannot be written.

    """
    path = path_or_none(picture)
    if path is not None:
        refuse_existing(path, overwrite=run.overwrite)
        check_suffix(path)
    one, other = (load_camera(in_folder(Path(given))).camera for given in (first, second))
    comparison = compare(one, other)
    if path is not None:
        write_picture(path, _picture(comparison), overwrite=run.overwrite)
    return ComparedFiles(comparison=comparison, picture=path)


def _picture(comparison: Comparison) -> Any:
    """The length of the difference at every pixel of the first camera, in colours."""
    width, height = comparison.first.image_size
    # Differences are smooth: one in each small block tells all.
    step = max(1, round((width * height / _DRAWN_PIXELS) ** 0.5))
    y, x = np.mgrid[:height:step, :width:step] + (step - 1) / 2
    coarse = np.linalg.norm(comparison.difference(np.stack([x, y], axis=-1)), axis=-1)
    return difference_picture(np.kron(coarse, np.ones((step, step)))[:height, :width])


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedRigFiles:
    """What became of :func:`compare_rig_files`.

    Attributes:
        units: of lengths; None where not known.
        cameras: how far apart the cameras of one name stand, and their lenses are.

    """

    units: str | None
    cameras: Sequence[ComparedPlace]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish compare --json`` prints of rigs."""
        return {"units": self.units, "cameras": [one.as_record() for one in self.cameras]}


def compare_rig_files(first: StrPath, second: StrPath) -> ComparedRigFiles:
    """Say how far apart two rigs are, camera by camera, as ``cubicfish compare`` does.

    Args:
        first: the file of a rig, or the folder of that.
        second: another one, whose cameras have the same names.

    Raises:
        CameraFileError: a file cannot be used.
        FitError: the rigs have fewer than two cameras in common, or other units.

    """
    rig = load_rig(rig_file_in(Path(first)))
    found = compare_rigs(rig, load_rig(rig_file_in(Path(second))))
    return ComparedRigFiles(units=rig.units, cameras=found)
