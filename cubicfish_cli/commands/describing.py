"""What cameras in files are, and how far apart two of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.app.asked import RUN, Run, StrPath, in_folder, path_or_none
from cubicfish_cli.app.difference_picture import difference_picture
from cubicfish_cli.app.undistortion.images import check_suffix, write_picture
from cubicfish_cli.core.assess.camera_facts import CameraFacts
from cubicfish_cli.core.assess.verdict import Verdict
from cubicfish_cli.core.files import refuse_existing
from cubicfish_cli.core.fit.comparison import Comparison, compare
from cubicfish_cli.core.io.camera_yaml import load_any_camera, load_camera

_DRAWN_PIXELS = 150_000


@dataclass(frozen=True, kw_only=True)
class CameraInfo:
    """What the file of a camera says.

    Attributes:
        model: the file.
        verdict: what the camera is worth; None of a camera that was not fitted.
        facts: the camera in the figures that people ask for first.

    """

    model: Path
    verdict: Verdict | None
    facts: CameraFacts

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish info --json`` prints."""
        return {"model": self.model, **self.facts.as_record()}


def info_files(calibration: StrPath) -> CameraInfo:
    """Say what a camera is, as ``cubicfish info`` does.

    Args:
        calibration: its file, or the folder of that.

    Raises:
        CameraFileError: the file cannot be used.

    """
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
