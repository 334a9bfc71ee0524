"""Undistortion maps in files for other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli.app.asked import RUN, Run, StrPath, in_folder
from cubicfish_cli.app.asked_pictures import MapOptions
from cubicfish_cli.app.undistortion.map_formats import (
    build_redistort_map,
    ffmpeg_command,
    map_contents,
    map_paths,
    view_files,
)
from cubicfish_cli.core.files import Content, refuse_existing, write_files
from cubicfish_cli.core.io.camera_yaml import load_camera
from cubicfish_cli.core.views.choose import ChosenView, SeenField, chosen_view
from cubicfish_cli.core.views.maps import (
    UndistortMap,
    build_map,
    camera_for_photos,
)
from cubicfish_cli.core.views.options import ViewOptions

Size = tuple[int, int]


def contents_of(
    plan: Mapping[str, Sequence[Path]], maps: Mapping[str, UndistortMap]
) -> dict[Path, Content]:
    """The files of all parts of a map, and what they hold."""
    return {
        path: content
        for part, paths in plan.items()
        for path, content in map_contents(paths, maps[part]).items()
    }


def files_of(plan: Mapping[str, Sequence[Path]]) -> list[Path]:
    """The files of all parts of a map."""
    return [path for paths in plan.values() for path in paths]


def ffmpeg_commands(plan: Mapping[str, Sequence[Path]]) -> list[str]:
    """The commands that apply maps in .pgm; none for others."""
    return [ffmpeg_command(*paths) for paths in plan.values() if paths[0].suffix.lower() == ".pgm"]


@dataclass(frozen=True, kw_only=True)
class MapFiles:
    """What became of :func:`map_files`.

    Attributes:
        model: the file of the camera.
        own: the maps.
        written: all files.
        image_size: (width, height) of the photos.
        view: what the maps show.
        seen: what the camera sees of it; None where that is not asked.
        ffmpeg: the commands that apply maps in .pgm.

    """

    model: Path
    own: list[Path]
    written: list[Path]
    image_size: Size
    view: ChosenView
    seen: SeenField | None = None
    ffmpeg: Sequence[str] = ()

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish map --json`` prints."""
        return {
            "model": self.model,
            "files": self.own,
            "extra_files": [path for path in self.written if path not in self.own],
            "image_size": self.image_size,
            "view": self.view.as_record(),
            "ffmpeg": self.ffmpeg,
        }


def map_files(
    camera: StrPath, output: StrPath, options: MapOptions | None = None, *, run: Run = RUN
) -> MapFiles:
    """Write the map of a camera, and the camera of what it shows, as ``cubicfish map`` does.

    Args:
        camera: its file, or the folder of that.
        output: where the map goes: a name in .npz, .exr, .png or .pgm; the files beside it have
            names that begin alike.
        options: what it shows.
        run: how the work is done.

    Raises:
        UsageError: the name ends otherwise.
        CubicfishError: the camera cannot be used, there is no such view, or a file exists and may
            not be replaced.

    """
    asked, goal = options or MapOptions(), Path(output)
    view = asked.view
    plan = map_paths(goal, view.parts if isinstance(view, ViewOptions) else ("",))
    refuse_existing(*files_of(plan), overwrite=run.overwrite)
    path = in_folder(Path(camera))
    loaded = load_camera(path).camera
    size = asked.photo_size or loaded.image_size
    there = camera_for_photos(loaded, size)
    chosen = chosen_view(there, view)
    build = build_redistort_map if asked.redistort else build_map
    maps = {name: build(there, one) for name, one in chosen.views.items()}
    files = {**contents_of(plan, maps), **view_files(maps, beside=goal)}
    return MapFiles(
        model=path,
        own=files_of(plan),
        written=write_files(files, overwrite=run.overwrite),
        image_size=size,
        view=chosen,
        seen=None if asked.redistort else chosen.seen_by(there),
        ffmpeg=ffmpeg_commands(plan),
    )
