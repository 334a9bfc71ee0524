"""``cubicfish export --to usd``: cameras as tables, which hold any lens."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli import __version__
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, working
from cubicfish_cli.errors import FitError

if TYPE_CHECKING:
    from cubicfish_cli.formats.lens_rig import Pose
    from cubicfish_cli.model.cubic import CubicCamera


def write_usd(
    folder: Path,
    cameras: Sequence[tuple[str, CubicCamera, Pose | None]],
    units: str | None,
    *,
    max_error: float,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write ``rig.usda`` and two tables a camera into a folder.

    Args:
        folder: where.
        cameras: name, camera and camera_from_rig of each; None where there is no rig.
        units: of lengths.
        max_error: of what is lost between the tables' entries, pixels.
        overwrite: whether existing files may be replaced.
        as_json: whether to print JSON.

    """
    import numpy as np

    from cubicfish_cli.files import Content, refuse_existing, write_files
    from cubicfish_cli.formats.lens_rig import METRES
    from cubicfish_cli.formats.usd_text import TableCamera, prim_name, usd_text
    from cubicfish_cli.undistortion.lens_tables import lens_tables
    from cubicfish_cli.undistortion.map_formats import require_exr, write_float_exr

    stage = folder / "rig.usda"
    names = {name: (f"{prim_name(name)}_enter.exr", f"{prim_name(name)}_leave.exr")
             for name, *_ in cameras}  # fmt: skip
    tables_of = [folder / file for pair in names.values() for file in pair]
    refuse_existing(stage, *tables_of, overwrite=overwrite)
    require_exr(folder / names[cameras[0][0]][0])
    files: dict[Path, Content] = {}
    placed, records = [], []
    for name, camera, place in cameras:
        rotation, translation = (np.eye(3), np.zeros(3)) if place is None else place
        with working(f"Making the tables of {name}"):
            tables = lens_tables(camera)
        if not tables.max_px <= max_error:
            raise FitError(
                f"camera {name}: the tables miss it by up to {tables.max_px:.2f} px between their "
                f"entries, more than the {max_error:g} px of --max-error: raise it"
            )
        note = [
            f"cubicfish {__version__}: the camera at every pixel",
            f"conversion error: RMS {tables.rms_px:.4f} px, largest {tables.max_px:.4f} px between "
            f"pixels, up to {camera.max_angle_deg:.1f} degrees from the axis",
        ]
        enter, leave = names[name]
        placed.append(
            TableCamera(
                name=name,
                image_size=camera.image_size,
                rotation=rotation.T,
                translation=-rotation.T @ translation,
                enter=enter,
                leave=leave,
                note=note,
            )
        )
        records.append({"name": name, "rms_px": tables.rms_px, "max_px": tables.max_px,
                        "max_angle_deg": camera.max_angle_deg})  # fmt: skip
        flat = np.zeros(tables.leave.shape[:2], np.float32)
        for file, channels in (
            (enter, np.moveaxis(tables.enter, -1, 0)),
            (leave, (*np.moveaxis(tables.leave, -1, 0), flat)),
        ):
            planes = {
                key: np.ascontiguousarray(one) for key, one in zip("RGB", channels, strict=True)
            }
            files[folder / file] = partial(write_float_exr, channels=planes)
    text = usd_text(placed, METRES.get(units or ""))
    written = write_files({stage: text, **files}, overwrite=overwrite)
    if as_json:
        print_json({"files": written, "format": "usd", "cameras": records})
        return
    print_wrote(written)
    for one in placed:
        result(f"{one.name}: {one.note[1]}")
