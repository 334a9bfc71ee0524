"""Reading another tool's camera file as the cubic camera nearest to its lens."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish import CameraFile, CameraFileError, did_you_mean, quoted
from cubicfish.files import StrPath
from cubicfish.fit import ImportedCamera, from_lens
from cubicfish.judge import FitRecord
from cubicfish.models import Lens
from cubicfish_cli.extension_guard import read_formats
from cubicfish_cli.foreign.file_contents import Fields
from cubicfish_cli.foreign.foreign_files import own_field_deg, read_foreign


@dataclass(frozen=True, kw_only=True, eq=False)
class Imported(CameraFile):
    """A camera that another tool's file holds, as a cubic camera.

    Attributes:
        camera: the camera; its ``max_angle_deg`` is how far it is trusted.
        fit: empty, since nothing was fitted to photos.
        made_by: the format, the lens, and how near the camera comes to it.
        written_by: the format of the file.
        lens: the lens in the file.
        conversion: how near ``camera`` comes, ``error`` in pixels, and what ended its field,
            ``ended_by``.
        knows_its_field: whether the file says how far its lens is trusted, as cubicfish's own do.
        file: the camera.yaml that was written; None if none was.

    """

    written_by: str
    lens: Lens
    conversion: ImportedCamera
    knows_its_field: bool
    file: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish import --json`` prints.

        Keys:
            model: the camera's file
            format: what wrote the file that was read
            lens: its lens model
            image_size: [width, height]
            rms_px: the RMS of the conversion
            max_px: its largest error
            max_angle_deg: the angle from the axis up to which these hold
            by_angle: a record a ring about the axis: from_deg, to_deg, rms_px, max_px
            trusted_deg: how far from the axis the camera is trusted
            field_ended_by: why no farther: photo, region, fold, angle or fit
            fold_deg: where the lens folds, if that is why

        """
        return {
            "model": self.file,
            "format": self.written_by,
            "lens": self.lens.name,
            "image_size": self.camera.image_size,
            **self.conversion.error.as_record(),
            "trusted_deg": self.camera.max_angle_deg,
            "field_ended_by": self.conversion.ended_by,
            "fold_deg": self.conversion.fold_deg,
        }


def import_camera(
    path: StrPath,
    *,
    written_by: str | None = None,
    camera: str | None = None,
    image_size: Sequence[int] | None = None,
    lens: str | None = None,
    max_angle_deg: float | None = None,
) -> Imported:
    """Read the camera in another tool's file, as ``cubicfish import`` does.

    Args:
        path: the file.
        written_by: its format, a name of ``cubicfish import --help`` such as ``kalibr``; by
            default the content decides.
        camera: which one, of files that hold several: ``cam1``, COLMAP's CAMERA_ID, ``1`` for M1
            and D1.
        image_size: (width, height) of the photos in pixels, for files that do not say.
        lens: ``fisheye`` or ``pinhole``: whose four coefficients are, for files that do not say.
        max_angle_deg: trust the lens up to this angle from its axis; by default as far as it
            shows anything in the photo, and at most 110°. Files do not say how far a lens was
            calibrated.

    Returns:
        ``camera``, and its error against the lens of the file: ``conversion.error``, pixels.
        ``save`` writes it.

    Raises:
        CameraFileError: there is no such format, the file cannot be used, or ``camera`` or
            ``image_size`` does not fit it.
        FitError: the lens sees nothing of its photo, or no sound cubic camera is near it.

    """
    path = Path(path)
    if written_by is not None and written_by not in read_formats():
        suggestion = did_you_mean(str(written_by), read_formats())
        raise CameraFileError(
            f"no format that is read is called {quoted(written_by)}: {suggestion}"
        )
    size = None
    if image_size is not None:
        size = Fields.of(path, {"image_size": [*map(int, image_size)]}).size_of("image_size")
    if lens not in (None, "fisheye", "pinhole"):
        raise CameraFileError(f"lens {quoted(lens)} is not known: fisheye, pinhole")
    read, found = read_foreign(path, name=written_by, camera=camera, image_size=size, lens=lens)
    own = own_field_deg(path)
    made = from_lens(read, max_angle_deg=own if max_angle_deg is None else max_angle_deg)
    near = {"rms_px": made.error.rms_px, "max_px": made.error.max_px}
    return Imported(
        camera=made.camera,
        fit=FitRecord(),
        made_by={
            "options": {"imported_from": found, "lens": read.name},
            "conversion": {**near, "field_ended_by": made.ended_by},
        },
        written_by=found,
        lens=read,
        conversion=made,
        knows_its_field=own is not None,
    )
