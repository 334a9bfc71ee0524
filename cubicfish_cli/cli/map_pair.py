"""``cubicfish map --pair``: the maps of two cameras whose pictures have common rows."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.options import changed
from cubicfish_cli.cli.terminal import print_json, print_wrote, result
from cubicfish_cli.cli.view_options import ViewOptions
from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.wording import either

if TYPE_CHECKING:
    from cubicfish_cli.formats.rig_yaml import RigFile, RigFileCamera
    from cubicfish_cli.undistortion.map_formats import Writer


def write_pair(
    output: Path,
    rig_file: Path,
    pair: tuple[str, str] | None,
    view: ViewOptions,
    photo_size: tuple[int, int] | None,
    writer: Callable[[Path], tuple[tuple[Path, ...], Writer]],
    *,
    mask: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a map for each of two cameras of a rig, and what it takes to measure with them.

    Args:
        output: what the maps are called, before the cameras' names.
        rig_file: the rig.
        pair: names of its cameras; None for a rig of two.
        view: what was asked of the pictures.
        photo_size: of the photos, where it is not the calibrated one.
        writer: the files of a map of some name, and what writes each.
        mask: where the masks go.
        overwrite: whether existing files may be replaced.
        as_json: whether to print JSON.

    """
    from cubicfish_cli.files import Content, refuse_existing, write_files
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rig_pictures import pair_maps
    from cubicfish_cli.plain_yaml import plain_yaml_text
    from cubicfish_cli.undistortion.view_files import part_name, view_files

    view = row_aligned(view)
    rig = load_rig(rig_file)
    both = [one.name for one in two_cameras(rig, pair)]
    parts = {name: writer(part_name(output, name)) for name in both}
    about = output.with_suffix(".stereo.yaml")
    own_files = [path for paths, _ in parts.values() for path in paths]
    refuse_existing(*own_files, about, overwrite=overwrite)
    made = pair_maps(
        rig,
        both[0],
        both[1],
        view.chosen,
        photo_size=photo_size,
        whole_field=view.leaves_field_open and view.kind == "epipolar-equirectangular",
    )
    files: dict[Path, Content] = {
        path: partial(write, index, made.maps[name])
        for name, (paths, write) in parts.items()
        for index, path in enumerate(paths)
    }
    files[about] = plain_yaml_text(made.record)
    files |= view_files(made.maps, mask=mask, beside=output)
    written = write_files(files, overwrite=overwrite)
    if as_json:
        print_json(
            {
                "model": str(rig_file),
                "files": own_files,
                "extra_files": [path for path in written if path not in own_files],
                "image_size": made.pair.image_size,
                "view": made.chosen.as_record(),
                "stereo": made.record,
                "ffmpeg": [],
            }
        )
        return
    result(f"wrote {written[0]}: {made.chosen.describe()}")
    print_wrote(written[1:])
    unit = f" {rig.units}" if rig.units else ""
    result(f"baseline {made.record['baseline']:.3f}{unit}; {made.record['depth']}")


def row_aligned(view: ViewOptions) -> ViewOptions:
    """What was asked of a picture, as of one whose rows agree with another camera's."""
    from cubicfish_cli.undistortion.stereo import ROW_ALIGNED

    yaw, _, roll = view.rotate
    if yaw or roll:
        raise click.UsageError(
            "rows of both pictures agree as long as they look up or down only: write --rotate "
            "0,PITCH,0"
        )
    if view.kind in ("cylindrical", "equirectangular"):
        view = changed(view, kind=f"epipolar-{view.kind}")
    if view.kind not in ROW_ALIGNED:
        kinds = either([kind.removeprefix("epipolar-") for kind in ROW_ALIGNED])
        raise click.UsageError(
            f"rows of {view.kind} pictures do not agree between cameras: choose --view {kinds}"
        )
    return view


def two_cameras(rig: RigFile, pair: tuple[str, str] | None) -> tuple[RigFileCamera, RigFileCamera]:
    """The cameras that are named, or those of a rig of two.

    Raises:
        CameraFileError: the rig has no such cameras, or more than two and none are named.

    """
    if pair is not None:
        return rig.camera(pair[0]), rig.camera(pair[1])
    if len(rig.cameras) != 2:
        names = ", ".join(one.name for one in rig.cameras)
        raise CameraFileError(f"name two of the rig's cameras with --pair: {names}")
    return rig.cameras[0], rig.cameras[1]
