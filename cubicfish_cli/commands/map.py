"""``cubicfish map``: the undistortion map alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run
from cubicfish.files import StrPath, write_files
from cubicfish.views import ViewOptions
from cubicfish_cli.commands.view_options import report_unseen, view_options
from cubicfish_cli.inputs.paths import in_folder
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, print_wrote, result

if TYPE_CHECKING:
    from cubicfish import View
    from cubicfish.files import Content
    from cubicfish.views import ChosenView, MapInBands

_HELP = """Write where in the photo each pixel of a view comes from, and the camera of the view.

\b
.npz  map_x and map_y (float32, -1 outside), valid, and the view as JSON text:
      cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR) renders the picture
.exr  STMap: x and y (upwards) in R and G, 0 to 1 across the frame, 32 bits
.png  the same as two 16-bit grey pictures, OUT_x.png and OUT_y.png
.pgm  the pair that ffmpeg's remap filter takes; the command is printed
"""

photo_size_option: Any = option(
    "--photo-size",
    "The size of the photos, if they are an exact rescale of the calibrated ones.",
    parameters.SIZE,
)


@record
class MapOptions:
    """Options of :func:`map_files`.

    Attributes:
        output: a name in .npz, .exr, .png or .pgm; the files beside it have names that begin alike.
        camera: the file or folder of the camera.
        view: the view, or options of one; by default flat, as for photos.
        photo_size: (width, height) of photos, an exact rescale of the calibrated ones.
        redistort: make the map back, from the view to the photo.

    """

    output: StrPath = parameters.argument(
        "Where the map goes: a name that ends in .npz, .exr, .png or .pgm.",
        metavar="OUT",
    )
    camera: StrPath = parameters.model_options
    view: View | ViewOptions | None = view_options
    photo_size: tuple[int, int] | None = photo_size_option
    redistort: bool = option(
        "--redistort", "Write the map of the way back, from the view to the camera's photo."
    )


@dataclass(frozen=True, kw_only=True)
class MapFiles:
    """Result of :func:`map_files`.

    Attributes:
        model: the file of the camera.
        own: files of the maps.
        written: all files.
        image_size: (width, height) of the photos.
        view: the view that the maps show.

    """

    model: Path
    own: list[Path]
    written: list[Path]
    image_size: tuple[int, int]
    view: ChosenView

    @property
    def ffmpeg(self) -> list[str]:
        """The commands that apply maps in .pgm; none for others."""
        from cubicfish_cli.undistortion.map_formats import ffmpeg_command

        pairs = [path for path in self.own if path.suffix.lower() == ".pgm"]
        return [ffmpeg_command(*both) for both in zip(pairs[::2], pairs[1::2], strict=True)]

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish map --json`` prints.

        Keys:
            model: the camera's file
            files: the map's files
            extra_files: the virtual camera, and the mask where it was asked for
            image_size: [width, height] of the photos that the map is for
            view: what is shown: kind, size, words, parts (the six of a cube), hfov_deg and
                vfov_deg where it has them, cut (whether the camera sees more than this kind can
                show), and what else the kind has
            ffmpeg: for .pgm, a command a part that applies the map

        """
        return {
            "model": self.model,
            "files": self.own,
            "extra_files": [path for path in self.written if path not in self.own],
            "image_size": self.image_size,
            "view": self.view.as_record(),
            "ffmpeg": self.ffmpeg,
        }


def map_files(options: MapOptions, *, run: Run = Run()) -> MapFiles:
    """Write the map of a camera, and the view's own camera, as ``cubicfish map`` does.

    Raises:
        UsageError: the name of the map has another suffix.
        CubicfishError: the camera cannot be used, there is no such view, or a file exists and may
            not be replaced.

    """
    from cubicfish.io import read_camera
    from cubicfish.views import MapInBands, choose_view
    from cubicfish_cli.undistortion.map_formats import camera_path, map_paths

    goal, view = Path(options.output), options.view
    path = in_folder(Path(options.camera))
    paths = map_paths(goal, view.parts if isinstance(view, ViewOptions) else ("",))
    Plan(run).reads(path).writes(*files_of(paths), *(camera_path(goal, part) for part in paths))
    loaded = read_camera(path)
    there = loaded.for_photos(options.photo_size or loaded.image_size)
    chosen = choose_view(there, view)
    assert chosen.camera is not None
    maps = {
        name: MapInBands.back(there, one)
        if options.redistort
        else MapInBands.of_camera(chosen.camera, one)
        for name, one in chosen.views.items()
    }
    return MapFiles(
        model=path,
        own=files_of(paths),
        written=write_maps(paths, maps, goal, run),
        image_size=there.image_size,
        view=chosen,
    )


def files_of(paths: Mapping[str, Sequence[Path]]) -> list[Path]:
    """Return the files of all parts of a map."""
    return [path for own in paths.values() for path in own]


def write_maps(
    paths: Mapping[str, Sequence[Path]],
    maps: Mapping[str, MapInBands],
    goal: Path,
    run: Run,
    more: Mapping[Path, Content] | None = None,
) -> list[Path]:
    """Write the files of all parts of a map, and the cameras of their views.

    Args:
        paths: part -> its files.
        maps: part -> its map.
        goal: the file whose name the cameras' files take over.
        run: how the work is done.
        more: other files to write with them.

    """
    from cubicfish_cli.undistortion.map_formats import map_contents, view_files

    files: dict[Path, Content] = {}
    for part, own in paths.items():
        files |= map_contents(own, maps[part])
    files |= {**(more or {})} | view_files(maps, beside=goal)
    return write_files(files, overwrite=run.overwrite, folder=goal.parent)


@as_command(
    "map",
    "Write an undistortion map for cv2.remap, ffmpeg or an STMap.",
    "cubicfish map left.npz --rotate -60,0,0 --hfov 80 --size 800x600",
    "cubicfish map undistort.exr --fit outer",
    "cubicfish map redistort.exr --fit outer --redistort",
    "cubicfish map flat.pgm --size 1920x1080",
    help=_HELP,
    do=map_files,
    how=("overwrite", "as_json"),
)
def command(made: MapFiles, given: MapOptions, how: How) -> None:
    """See ``_HELP``."""
    print_maps(made, how)
    if not (how.as_json or given.redistort):
        report_unseen(made.view)


def print_maps(made: MapFiles, how: How, more: str = "") -> None:
    """Print the files and the view, and a line ``more``."""
    if how.print(made):
        return
    result(f"wrote {made.written[0]}: {made.view.describe()}")
    print_wrote(made.written[1:])
    if more:
        result(more)
    for line in made.ffmpeg:
        result(f"apply it with: {line}", whole=True)
    if made.ffmpeg:
        print_message(
            "note: ffmpeg's remap takes the nearest pixel, so edges are jagged: 'cubicfish "
            "undistort in.mp4 out.mp4' interpolates"
        )
