"""``cubicfish rig map``: maps of two cameras, after which both show things in equal rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import CameraFileError, Run, UsageError, ViewError, listed
from cubicfish.files import StrPath
from cubicfish.views import ViewOptions
from cubicfish_cli.commands.map import MapFiles, files_of, photo_size_option, print_maps, write_maps
from cubicfish_cli.commands.view_options import view_bundle
from cubicfish_cli.extensions.rigs.options import pair_option, rig_option
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How

if TYPE_CHECKING:
    from cubicfish import View

_HELP = """Write two maps of the rig's cameras that --pair names: OUT_left.npz and OUT_right.npz.

In pictures rendered with them, both cameras show the same thing in the same row. Flat
pictures end before 180°; --view cylindrical and equirectangular are then about the line between
the cameras and go on all around it. OUT.stereo.yaml has what it takes to get from disparities to
points: baseline, focal length, and of flat ones P1, P2 and Q. Maps are written as
'cubicfish map' does: .npz, .exr, .png or .pgm.
"""

_KINDS = ("perspective", "cylindrical", "equirectangular")


@record
class RigMapOptions:
    """What the maps of two of a rig's cameras show, and where they go.

    Attributes:
        output: a name in .npz, .exr, .png or .pgm, with which theirs begin.
        rig: its rig.yaml, or the folder of that.
        pair: names of the cameras; None for a rig of two.
        view: the view, or options of one; by default flat.
        photo_size: (width, height) of photos, an exact rescale of the calibrated ones.

    """

    output: StrPath = parameters.argument(
        "Where the maps go: a name that ends in .npz, .exr, .png or .pgm.",
        metavar="OUT",
    )
    rig: StrPath = rig_option
    pair: tuple[str, str] | None = pair_option
    view: View | ViewOptions | None = view_bundle(
        kinds=f"{listed(_KINDS, word='or')}; the last two about the line between the cameras",
        size_default="the first camera's photo's; equirectangular is as large as what both see",
        field_default="perspective keeps the first photo's scale in its middle, up to 120 along "
        "the longer side; others show what both cameras see",
        whole=False,
    )
    photo_size: tuple[int, int] | None = photo_size_option


@dataclass(frozen=True, kw_only=True)
class PairMapFiles(MapFiles):
    """What became of :func:`map_rig_files`: beside what a :class:`MapFiles` has

    Attributes:
        stereo: what it takes to get from disparities to points.

    """

    stereo: Mapping[str, Any]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig map --json`` prints.

        Keys:
            model: the rig's file
            files: the maps' files
            extra_files: OUT.stereo.yaml, and the virtual camera
            image_size: [width, height] of the photos that the maps are for
            view: what is shown: kind, size, words, parts (the six of a cube), hfov_deg and
                vfov_deg where it has them, cut (whether the camera sees more than this kind can
                show), and what else the kind has
            stereo: what OUT.stereo.yaml holds: cameras, units, baseline, focal, depth and what
                else it takes to measure
            ffmpeg: for .pgm, a command a map that applies it

        """
        return {**super().as_record(), "stereo": self.stereo}


def map_rig_files(options: RigMapOptions, *, run: Run = Run()) -> PairMapFiles:
    """Write a map for each of two cameras of a rig, as ``cubicfish rig map`` does.

    Returns:
        The files, and in ``stereo`` what it takes to get from disparities to points.

    Raises:
        UsageError: the name ends otherwise, or rows of such views do not agree between cameras.
        CubicfishError: the rig cannot be used, the two cameras see nothing in common, or a file
            exists and may not be replaced.

    """
    import numpy as np

    from cubicfish import load_rig, rectify
    from cubicfish.views import CentralView, ChosenView, MapInBands, choose_view
    from cubicfish_cli.undistortion.map_formats import camera_path, map_paths

    goal, photo_size = Path(options.output), options.photo_size
    map_paths(goal)  # its name is refused first
    view = _describe_row_aligned(options.view)
    loaded = load_rig(options.rig)
    both = options.pair or tuple(one.name for one in loaded.cameras)
    if len(both) != 2:
        raise CameraFileError(f"name two of the rig's cameras with --pair: {', '.join(both)}")
    about = goal.with_suffix(".stereo.yaml")
    plan = map_paths(goal, both)
    register = Plan(run).reads(loaded.files)
    register.writes(*files_of(plan), about, *(camera_path(goal, one) for one in both))
    between = rectify(loaded, *both)
    if photo_size is not None:
        one, other = (loaded.camera(name).camera.for_photos(photo_size) for name in both)
        between = replace(between, cameras=(one, other))
    if np.isnan(between.project([0.0, 0.0, 1.0])).any():
        raise ViewError(
            "the two cameras see nothing in common where both look: name two others with --pair"
        )
    chosen = choose_view(between, view)
    common = chosen.first
    if not isinstance(common, CentralView):
        raise ViewError("rows of both pictures agree in one central view only")
    if (
        isinstance(view, ViewOptions)
        and view.leaves_field_open
        and view.kind == "epipolar-equirectangular"
    ):
        common = between.field_view(common)
        chosen = ChosenView(views={"": common})
    turned = zip(both, between.cameras, between.views(common), strict=True)
    maps = {name: MapInBands.of_camera(camera, own) for name, camera, own in turned}
    return PairMapFiles(
        model=loaded.files[0],
        own=files_of(plan),
        written=write_maps(plan, maps, goal, run, {about: between.text(common)}),
        image_size=between.image_size,
        view=chosen,
        stereo=between.as_record(common),
    )


def _describe_row_aligned(view: View | ViewOptions | None) -> View | ViewOptions:
    """What was asked of a picture, as of one whose rows agree with another camera's."""
    if view is not None and not isinstance(view, ViewOptions):
        return view
    view = view or ViewOptions()
    yaw, _, roll = view.rotate_deg
    if yaw or roll:
        raise UsageError(
            "rows of both pictures agree as long as they look up or down only: write --rotate "
            "0,PITCH,0"
        )
    kind = (view.kind or "perspective").removeprefix("epipolar-")
    if kind not in _KINDS:
        raise UsageError(
            f"rows of {kind} pictures do not agree between cameras: choose --view "
            f"{listed(_KINDS, word='or')}"
        )
    return view if kind == "perspective" else replace(view, kind=f"epipolar-{kind}")


@as_command(
    "map",
    "Write stereo rectification maps for two cameras.",
    "cubicfish rig map stereo.npz --pair left,right",
    "cubicfish rig map stereo.npz --model rig --view equirectangular",
    do=map_rig_files,
    how=("overwrite", "as_json"),
    help=_HELP,
)
def command(made: PairMapFiles, given: RigMapOptions, how: How) -> None:
    """See ``_HELP``."""
    unit = f" {made.stereo['units']}" if made.stereo["units"] else ""
    depth = f"baseline {made.stereo['baseline']:.3f}{unit}; {made.stereo['depth']}"
    print_maps(made, how, depth)
