"""What simulated photos are taken with, and from where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli.app.asked import StrPath
from cubicfish_cli.app.lenses.foreign_files import is_foreign, read_foreign
from cubicfish_cli.app.viewpoints.truth import Pose, load_poses
from cubicfish_cli.app.viewpoints.views import NearLens, WholeLens
from cubicfish_cli.core.arrays import Refusal
from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.errors import CameraFileError, CorrespondenceError, UsageError
from cubicfish_cli.core.io.camera_yaml import Calibrated, camera_text, load_camera
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import MAX_SIDE
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.wording import quoted


@dataclass(frozen=True, kw_only=True)
class Source:
    """What photos are taken with.

    Attributes:
        lens: the true lens.
        image_size: (width, height) of the photos.
        text: what true_camera.yaml holds.
        note: of which tool's lens that is the nearest camera, and how near; None if it is that.

    """

    lens: WholeLens
    image_size: tuple[int, int]
    text: str
    note: Mapping[str, Any] | None = None


def source_of(
    lens: Calibrated | CubicCamera | StrPath, image_size: Sequence[int] | None, target: Target
) -> Source:
    """What a caller names: a camera, a fit or a file of one; see ``SimulateOptions``.

    Raises:
        UsageError: a size is given of photos whose size the camera says.
        CameraFileError: it cannot be used, or is for photos of another size.

    """
    size = None
    if image_size is not None:
        size = Refusal(error=CameraFileError).size(image_size, "image_size", limit=MAX_SIDE)
    if not isinstance(lens, Calibrated | CubicCamera) and is_foreign(Path(lens)):
        source = _of_another_tool(Path(lens), size)
        if size not in (None, source.image_size):
            raise CameraFileError(
                "the lens is for photos of {}x{} pixels: leave --size out".format(
                    *source.image_size
                )
            )
        return source
    if size is not None:
        raise UsageError(
            "the camera says the size of its photos: --size goes with --lens and a file of "
            "another tool"
        )
    if isinstance(lens, Calibrated | CubicCamera):
        return _of_camera(lens.camera if isinstance(lens, Calibrated) else lens, {}, target)
    return _of_camera(load_camera(Path(lens)).camera, {"camera": str(lens)}, target)


def _of_camera(camera: CubicCamera, made_by: Mapping[str, object], target: Target) -> Source:
    """A camera, which sees the target as near as it is."""
    camera = camera.in_units(target.units)
    lens = NearLens(camera=camera) if camera.pupil_travel else camera
    return Source(lens=lens, image_size=camera.image_size, text=_camera_text(camera, made_by))


def _of_another_tool(path: Path, size: tuple[int, int] | None) -> Source:
    """The lens of another tool's file."""
    # Loaded late: it takes as long as a photo.
    from cubicfish_cli.app.lenses.from_lens import ExactLens

    given, found = read_foreign(path, image_size=size)
    exact = ExactLens.of(given)
    text = _camera_text(exact.nearest.camera, {"imported_from": found, "lens": given.name})
    note = {"found": found, "rms_px": exact.nearest.error.rms_px}
    return Source(lens=exact, image_size=given.image_size, text=text, note=note)


def _camera_text(camera: CubicCamera, made_by: Mapping[str, object]) -> str:
    return camera_text(camera, fit=FitRecord(), made_by={"command": "simulate", **made_by})


def poses_of_table(path: Path, form: str) -> dict[str, Pose]:
    """Read the poses of a table, by the photos' file names.

    Raises:
        CorrespondenceError: a row names no file of its own, or the table cannot be used.

    """
    named: dict[str, Pose] = {}
    for name, pose in load_poses(path).items():
        own = Path(name).stem + f".{form}"
        if Path(name).name != name or own in named or own.startswith("."):
            raise CorrespondenceError(
                f"{path}: {quoted(name)} cannot be the name of a photo here: give each row a file "
                "name of its own, without folders"
            )
        named[own] = pose
    return named
