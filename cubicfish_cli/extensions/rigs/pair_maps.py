"""Maps of two cameras of a rig in files, after which both show things in equal rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.app.asked import RUN, Run, StrPath
from cubicfish_cli.app.undistortion.map_formats import map_paths
from cubicfish_cli.commands.map import MapFiles, files_of, write_maps
from cubicfish_cli.core.errors import CameraFileError, UsageError, ViewError
from cubicfish_cli.core.files import refuse_existing
from cubicfish_cli.core.plain_yaml import plain_yaml_text
from cubicfish_cli.core.views.choose import ChosenView, chosen_view, sees
from cubicfish_cli.core.views.maps import build_map, camera_for_photos
from cubicfish_cli.core.views.options import ViewOptions
from cubicfish_cli.core.views.view import CentralView, View
from cubicfish_cli.core.wording import either
from cubicfish_cli.extensions.rigs.rig import Rig, load_rig, rig_file
from cubicfish_cli.extensions.rigs.stereo import ROW_ALIGNED, rectify


@dataclass(frozen=True, kw_only=True)
class PairMapFiles(MapFiles):
    """What became of :func:`map_rig_files`: beside what a :class:`MapFiles` has

    Attributes:
        stereo: what it takes to get from disparities to points.

    """

    stereo: Mapping[str, Any]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig map --json`` prints."""
        return {**super().as_record(), "stereo": self.stereo}


def map_rig_files(
    rig: StrPath,
    output: StrPath,
    view: View | ViewOptions | None = None,
    *,
    pair: tuple[str, str] | None = None,
    photo_size: tuple[int, int] | None = None,
    run: Run = RUN,
) -> PairMapFiles:
    """Write a map for each of two cameras of a rig, as ``cubicfish rig map`` does.

    Args:
        rig: its rig.yaml, or the folder of that.
        output: where the maps go: a name in .npz, .exr, .png or .pgm, with which theirs begin.
        view: what they show, or what is asked of it; by default flat.
        pair: names of the cameras; None for a rig of two.
        photo_size: (width, height) of photos, an exact rescale of the calibrated ones.
        run: how the work is done.

    Returns:
        The files, and in ``stereo`` what it takes to get from disparities to points.

    Raises:
        UsageError: the name ends otherwise, or rows of such views do not agree between cameras.
        CubicfishError: the rig cannot be used, the two cameras see nothing in common, or a file
            exists and may not be replaced.

    """
    goal = Path(output)
    map_paths(goal)  # its name is refused first
    asked = _row_aligned(view)
    path = rig_file(rig)
    loaded = load_rig(path)
    both = _two_cameras(loaded, pair)
    about = goal.with_suffix(".stereo.yaml")
    plan = map_paths(goal, both)
    refuse_existing(*files_of(plan), about, overwrite=run.overwrite)
    between = rectify(loaded, *both)
    if photo_size is not None:
        one, other = (camera_for_photos(loaded.camera(name).camera, photo_size) for name in both)
        between = replace(between, cameras=(one, other))
    if not sees(between, np.array([0.0, 0.0, 1.0])):
        raise ViewError(
            "the two cameras see nothing in common where both look: name two others with --pair"
        )
    chosen = chosen_view(between, asked)
    common = chosen.first
    if not isinstance(common, CentralView):
        raise ViewError("rows of both pictures agree in one central view only")
    if (
        isinstance(asked, ViewOptions)
        and asked.leaves_field_open
        and asked.kind == "epipolar-equirectangular"
    ):
        common = between.field_view(common)
        chosen = ChosenView(views={"": common})
    turned = zip(both, between.cameras, between.views(common), strict=True)
    maps = {name: build_map(camera, own) for name, camera, own in turned}
    about_pair = {
        "cameras": list(both),
        "units": loaded.units,
        "photo_sizes": [list(camera.image_size) for camera in between.cameras],
        **between.as_record(common),
    }
    more = {about: plain_yaml_text(about_pair)}
    return PairMapFiles(
        model=path,
        own=files_of(plan),
        written=write_maps(plan, maps, goal, run, more),
        image_size=between.image_size,
        view=chosen,
        stereo=about_pair,
    )


def _row_aligned(view: View | ViewOptions | None) -> View | ViewOptions:
    """What was asked of a picture, as of one whose rows agree with another camera's."""
    if isinstance(view, View):
        return view
    view = view or ViewOptions()
    yaw, _, roll = view.rotate_deg
    if yaw or roll:
        raise UsageError(
            "rows of both pictures agree as long as they look up or down only: write --rotate "
            "0,PITCH,0"
        )
    if view.kind in ("cylindrical", "equirectangular"):
        view = replace(view, kind=f"epipolar-{view.kind}")
    if (view.kind or "perspective") not in ROW_ALIGNED:
        kinds = either([kind.removeprefix("epipolar-") for kind in ROW_ALIGNED])
        raise UsageError(
            f"rows of {view.kind} pictures do not agree between cameras: choose --view {kinds}"
        )
    return view


def _two_cameras(rig: Rig, pair: tuple[str, str] | None) -> tuple[str, str]:
    """Names of the cameras that are named, or of those of a rig of two."""
    if pair is not None:
        return rig.camera(pair[0]).name, rig.camera(pair[1]).name
    names = [one.name for one in rig.cameras]
    if len(names) != 2:
        raise CameraFileError(f"name two of the rig's cameras with --pair: {', '.join(names)}")
    return names[0], names[1]
