"""``cubicfish rig undistort``: the photos of each shot to one picture of all that they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish import Run, UsageError, listed
from cubicfish.files import StrPath
from cubicfish.views import ViewOptions
from cubicfish_cli.commands.undistort import PictureOptions, named_sources, print_pictures
from cubicfish_cli.commands.view_options import report_unseen, view_bundle
from cubicfish_cli.extensions.rigs.options import rig_option
from cubicfish_cli.inputs.paths import paths_of
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, as_command, option, record
from cubicfish_cli.terminal.progress import How

if TYPE_CHECKING:
    from cubicfish import View
    from cubicfish_cli.commands.pictures import UndistortedFiles


@record
class RigUndistortOptions(PictureOptions):
    """Photos of a rig's cameras, and beside what a :class:`PictureOptions` has

    Attributes:
        photos: files, folders and globs. A photo is of the camera that its folder is called after,
            or that its own name begins with; where nothing is called after a camera, they are in
            the cameras' order.
        output: a folder; of one shot also a name for its result.
        rig: its rig.yaml, or the folder of that.
        view: by default all around, as longitude and latitude.
        distance: how far away things are that the cameras' pictures join at, in the rig's unit;
            None for far away.

    Raises:
        UsageError: one is not usable.

    """

    photos: StrPath | Sequence[StrPath] = parameters.argument(
        "Photos of the rig's cameras: files, folders or globs; '-' reads their names from stdin.",
        type=parameters.NAME,
        nargs=-1,
        required=True,
        metavar="IN...",
    )
    output: StrPath = parameters.argument(
        "The picture that is made of one shot; of several, or without a suffix, a folder.",
        metavar="OUT",
    )
    rig: StrPath = rig_option
    view: View | ViewOptions | None = view_bundle(
        kinds=listed([kind for kind in ViewOptions.KINDS if kind != "cube"], word="or"),
        kind_default="equirectangular, all around",
        size_default="equirectangular is as large as all that the cameras see at the photos' "
        "scale; others have the largest photo's",
        field_default="--fit outer; perspective keeps the first photo's scale in its middle, up to "
        "120 along the longer side",
        whole=False,
    )
    distance: float | None = option(
        "--distance UNITS",
        "How far away things are that the cameras' pictures join at. [default: far away]",
        FloatRange(0, min_open=True),
    )


def undistort_rig_files(options: RigUndistortOptions, *, run: Run = Run()) -> UndistortedFiles:
    """Make one picture of each shot of a rig, as ``cubicfish rig undistort`` does.

    One that fails does not stop the others.

    Returns:
        The ``files`` that were written, what was ``skipped``, and what ``failed`` and why.

    Raises:
        UsageError: the options do not go together, or it is not known whose a photo is.
        PhotoError: there are none.
        OutputError: a result exists, and it may be neither replaced nor left.
        CubicfishError: the rig or the executor cannot be used.

    """
    from cubicfish import load_rig
    from cubicfish.rigs import Body
    from cubicfish.views import choose_view
    from cubicfish_cli.commands.pictures import plan_pictures, write_pictures
    from cubicfish_cli.extensions.rigs.shots import RigViews, shots_of, sizes_of

    known = load_rig(options.rig)
    names, sources = [one.name for one in known.cameras], paths_of(named_sources(options.photos))
    if not sources:
        raise UsageError("no photos are named: name those of each camera")
    shots = shots_of(sources, names, run.listener)
    suffix = next(iter(next(iter(shots.values())).values())).suffix
    jobs = {name: (f"{name}{suffix}", own) for name, own in shots.items()}
    register = Plan(run, skip_existing=options.skip_existing).reads(known.files)
    alone = len(shots) == 1
    plan = plan_pictures("shot", jobs, Path(options.output), options, register, alone=alone)
    view = options.view or ViewOptions()
    if isinstance(view, ViewOptions) and view.kind is None:
        view = replace(view, kind="equirectangular")
    body = Body(cameras=known.cameras, distance=options.distance)
    body = body.for_photos(sizes_of(shots.values()))
    views = RigViews(body, choose_view(body, view), options.interpolation)
    return write_pictures(plan, views, run, model=known.files[0])


@as_command(
    "undistort",
    "Stitch the photos of each shot.",
    "cubicfish rig undistort left/1.png right/1.png all.png",
    "cubicfish rig undistort shots/ around/ --view cylindrical --hfov 360 --distance 3000",
    do=undistort_rig_files,
    how=("overwrite", "as_json", "jobs", "scheduler"),
)
def command(made: UndistortedFiles, given: RigUndistortOptions, how: How) -> None:
    """Render the photos IN that a rig's cameras took of one shot as one picture OUT.

    It is a panorama in any --view (equirectangular unless another is named). A photo is of the
    camera that its folder is called after, or that its name begins with; otherwise name one of
    each, in the rig's order. IN may also be a folder with a folder for each camera: photos of the
    same name are one shot, and each shot becomes one picture in the folder OUT.
    """
    if made.view is not None and not how.as_json:
        report_unseen(made.view)
    print_pictures(made, how)
