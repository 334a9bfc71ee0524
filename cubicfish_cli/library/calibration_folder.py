"""The folder of a calibration: which files it has, written together or not at all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from cubicfish_cli.corner_files.observations_csv import save_corners
from cubicfish_cli.errors import OutputError
from cubicfish_cli.files import Content, refuse_existing, write_files
from cubicfish_cli.fitting.calibration import Calibration
from cubicfish_cli.fitting.point_fit import PointCalibration
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.photos import MAX_PIXELS
from cubicfish_cli.target import target_text
from cubicfish_cli.undistortion.choose import default_view
from cubicfish_cli.undistortion.maps import build_map, save_map

NAMES = {
    "camera": "camera.yaml",
    "map": "undistort_map.npz",
    "target": "target.refined.yaml",
    "report": "report.html",
    "corners": "corners.csv",
    "drawn": "target.yaml",
}
"""Of its files by what they hold; the camera is the first to go and the last to be there."""

# Made by a calibration only, and true of its camera only. A corners.csv may be the user's own.
_ITS_OWN = ("map", "target", "report")


@dataclass(frozen=True, kw_only=True)
class CalibrationFolder:
    """A folder that a calibration is to be written into.

    Attributes:
        path: the folder.
        inputs: what the calibration is made from, which stays as it is.

    """

    path: Path
    inputs: Sequence[Path]

    def refuse(self, *kinds: str, overwrite: bool) -> None:
        """Refuse at once what cannot be written at the end, by its name in :data:`NAMES`.

        Raises:
            OutputError: a file exists and ``overwrite`` is false, or cannot be written.

        """
        refuse_existing(*(self.path / NAMES[kind] for kind in kinds), overwrite=overwrite)

    def refuse_input(self, kind: str) -> None:
        """Refuse to replace a file, also with ``overwrite``, that the calibration is made from.

        Raises:
            OutputError: it is one.

        """
        if self.has_input(kind):
            raise OutputError(
                f"{self.path / NAMES[kind]} would be replaced, and is what this calibration is "
                "made from: choose another folder with -o"
            )

    def has_input(self, kind: str) -> bool:
        """Whether one of its files is what the calibration is made from."""
        return self._is_input(self.path / NAMES[kind])

    def write(
        self, contents: Mapping[str, Content | None], *, overwrite: bool
    ) -> tuple[dict[str, Path], list[Path]]:
        """Write its files, all or none; of an earlier calibration nothing is left.

        Args:
            contents: by their names in :data:`NAMES`; None for what is not there.
            overwrite: whether files may be replaced.

        Returns:
            Where each is, and what went of an earlier calibration.

        Raises:
            OutputError: one exists and ``overwrite`` is false, or cannot be written.

        """
        paths = {kind: self.path / NAMES[kind] for kind in NAMES if contents.get(kind) is not None}
        others = [self.path / NAMES[kind] for kind in _ITS_OWN if kind not in paths]
        obsolete = [path for path in others if path.is_file() and not self._is_input(path)]
        files = {path: contents[kind] or "" for kind, path in paths.items()}
        write_files(files, overwrite=overwrite, obsolete=obsolete if overwrite else ())
        return paths, [path for path in obsolete if not path.exists()]

    def _is_input(self, path: Path) -> bool:
        return any(one.exists() and path.exists() and path.samefile(one) for one in self.inputs)


def contents_of(
    fitted: Calibration | PointCalibration,
    corners: Observations | None = None,
    drawn: str | None = None,
) -> dict[str, Content | None]:
    """What :meth:`CalibrationFolder.write` takes of a fit of either lift, but for the report.

    Args:
        fitted: the fit, with where it comes from.
        corners: what it was made from, where that is to be kept.
        drawn: the text of the target as drawn, where that is in no file yet.

    Returns:
        By their names in :data:`NAMES`; ``map`` is None where it would take gigabytes.

    """
    contents: dict[str, Content | None] = {"drawn": drawn, "camera": fitted.text()}
    if corners is not None:
        contents["corners"] = partial(save_corners, corners=corners, overwrite=False)
    if isinstance(fitted, Calibration):
        contents["map"] = _map(fitted.camera)
        if fitted.refined != "off" and fitted.target is not None:
            contents["target"] = target_text(fitted.target)
    return contents


def _map(camera: CubicCamera) -> Content | None:
    if math.prod(camera.image_size) > MAX_PIXELS:
        return None
    return lambda path: save_map(path, build_map(camera, default_view(camera)), overwrite=False)
