"""Undistortion maps of a camera, or of two cameras of a rig, in files for other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError, UsageError, ViewError
from cubicfish_cli.files import Content, refuse_existing, write_files
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.formats.rig_yaml import RigFile, load_rig
from cubicfish_cli.library.asked import RUN, Run, StrPath, in_folder, rig_in
from cubicfish_cli.library.asked_pictures import MapOptions
from cubicfish_cli.library.rig_pictures import rectify
from cubicfish_cli.plain_yaml import plain_yaml_text
from cubicfish_cli.undistortion.choose import ChosenView, SeenField, chosen_view
from cubicfish_cli.undistortion.fit import sees
from cubicfish_cli.undistortion.map_formats import (
    build_redistort_map,
    ffmpeg_command,
    map_contents,
    map_paths,
    view_files,
)
from cubicfish_cli.undistortion.maps import (
    UndistortMap,
    build_map,
    camera_for_photos,
)
from cubicfish_cli.undistortion.options import ViewOptions
from cubicfish_cli.undistortion.rigs import ROW_ALIGNED
from cubicfish_cli.undistortion.view import CentralView, View
from cubicfish_cli.wording import either

Size = tuple[int, int]


def _contents_of(
    plan: Mapping[str, Sequence[Path]], maps: Mapping[str, UndistortMap]
) -> dict[Path, Content]:
    """The files of all parts of a map, and what they hold."""
    return {
        path: content
        for part, paths in plan.items()
        for path, content in map_contents(paths, maps[part]).items()
    }


def _files_of(plan: Mapping[str, Sequence[Path]]) -> list[Path]:
    return [path for paths in plan.values() for path in paths]


@dataclass(frozen=True, kw_only=True)
class MapFiles:
    """What became of :func:`map_files`.

    Attributes:
        model: the file of the camera or the rig.
        own: the maps.
        written: all files.
        image_size: (width, height) of the photos.
        view: what the maps show.
        seen: what the camera sees of it; None where that is not asked.
        ffmpeg: the commands that apply maps in .pgm.
        stereo: what it takes to get from disparities to points; None for one camera.

    """

    model: Path
    own: list[Path]
    written: list[Path]
    image_size: Size
    view: ChosenView
    seen: SeenField | None = None
    ffmpeg: Sequence[str] = ()
    stereo: Mapping[str, Any] | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish map --json`` prints."""
        return {
            "model": self.model,
            "files": self.own,
            "extra_files": [path for path in self.written if path not in self.own],
            "image_size": self.image_size,
            "view": self.view.as_record(),
            **({} if self.stereo is None else {"stereo": self.stereo}),
            "ffmpeg": self.ffmpeg,
        }


def map_files(
    camera: StrPath, output: StrPath, options: MapOptions | None = None, *, run: Run = RUN
) -> MapFiles:
    """Write the map of a camera, and the camera of what it shows, as ``cubicfish map`` does.

    Of a rig it writes a map for each of two cameras, after which both show things in equal rows.

    Args:
        camera: its file, or the folder of that; or the file of a rig.
        output: where the map goes: a name in .npz, .exr, .png or .pgm; the files beside it, and
            the maps of two cameras, have names that begin alike.
        options: what it shows.
        run: how the work is done.

    Returns:
        The files, and of a rig in ``stereo`` what it takes to get from disparities to points.

    Raises:
        UsageError: what is asked does not go together, or rows of such views do not agree between
            cameras.
        CubicfishError: the camera or the rig cannot be used, there is no such view, the two
            cameras see nothing in common, or a file exists and may not be replaced.

    """
    asked, goal = options or MapOptions(), Path(output)
    map_paths(goal)  # its name is refused first
    rig = rig_in(Path(camera))
    asked.refuse_unused(of_rig=rig is not None)
    return (
        _map_of_camera(camera, goal, asked, run)
        if rig is None
        else _map_pair(rig, goal, asked, run)
    )


def _map_of_camera(camera: StrPath, goal: Path, asked: MapOptions, run: Run) -> MapFiles:
    view = asked.view
    plan = map_paths(goal, view.parts if isinstance(view, ViewOptions) else ("",))
    refuse_existing(*_files_of(plan), overwrite=run.overwrite)
    path = in_folder(Path(camera))
    loaded = load_camera(path).camera
    size = asked.photo_size or loaded.image_size
    there = camera_for_photos(loaded, size)
    chosen = chosen_view(there, view)
    build = build_redistort_map if asked.redistort else build_map
    maps = {name: build(there, one) for name, one in chosen.views.items()}
    files = {**_contents_of(plan, maps), **view_files(maps, beside=goal)}
    is_pair = goal.suffix.lower() == ".pgm"
    return MapFiles(
        model=path,
        own=_files_of(plan),
        written=write_files(files, overwrite=run.overwrite),
        image_size=size,
        view=chosen,
        seen=None if asked.redistort else chosen.seen_by(there),
        ffmpeg=[ffmpeg_command(*paths) for paths in plan.values()] if is_pair else [],
    )


def _map_pair(path: Path, goal: Path, options: MapOptions, run: Run) -> MapFiles:
    asked = _row_aligned(options.view)
    loaded = load_rig(path)
    both = _two_cameras(loaded, options.pair)
    about = goal.with_suffix(".stereo.yaml")
    plan = map_paths(goal, both)
    refuse_existing(*_files_of(plan), about, overwrite=run.overwrite)
    between = rectify(loaded, *both)
    if options.photo_size is not None:
        one, other = (
            camera_for_photos(loaded.camera(name).camera, options.photo_size) for name in both
        )
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
    record = {
        "cameras": list(both),
        "units": loaded.units,
        "photo_sizes": [list(camera.image_size) for camera in between.cameras],
        **between.as_record(common),
    }
    views = view_files(maps, beside=goal)
    files = {**_contents_of(plan, maps), about: plain_yaml_text(record), **views}
    is_pair = goal.suffix.lower() == ".pgm"
    return MapFiles(
        model=path,
        own=_files_of(plan),
        written=write_files(files, overwrite=run.overwrite),
        image_size=between.image_size,
        view=chosen,
        ffmpeg=[ffmpeg_command(*paths) for paths in plan.values()] if is_pair else [],
        stereo=record,
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


def _two_cameras(rig: RigFile, pair: tuple[str, str] | None) -> tuple[str, str]:
    """Names of the cameras that are named, or of those of a rig of two."""
    if pair is not None:
        return rig.camera(pair[0]).name, rig.camera(pair[1]).name
    names = [one.name for one in rig.cameras]
    if len(names) != 2:
        raise CameraFileError(f"name two of the rig's cameras with --pair: {', '.join(names)}")
    return names[0], names[1]
