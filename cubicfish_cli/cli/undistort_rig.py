"""``cubicfish undistort --rig``: the photos of a shot to one picture, or to faces for splats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import changed
from cubicfish_cli.cli.progress import listening
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, tell
from cubicfish_cli.cli.view_options import ViewOptions
from cubicfish_cli.errors import PhotoError

if TYPE_CHECKING:
    from cubicfish_cli.cli.view_options import PlaneOptions, RigOptions
    from cubicfish_cli.formats.rig_yaml import RigFile
    from cubicfish_cli.library.rig_shots import Done, Shot
    from cubicfish_cli.undistortion.choose import ChosenView
    from cubicfish_cli.undistortion.images import Rendering
    from cubicfish_cli.undistortion.mosaic import Body, Ground


def undistort_rig(
    sources: Sequence[str],
    destination: Path,
    asked: RigOptions,
    view: ViewOptions,
    plane: PlaneOptions,
    rendering: Rendering,
    *,
    mask: Path | None,
    camera_out: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Make a picture of every shot of a rig.

    Args:
        sources: photos, or folders of them.
        destination: the picture of one shot, or the folder of several.
        asked: the rig, and what was asked of it.
        view: what was asked of the picture.
        plane: what was asked of a plane.
        rendering: how pixels are made.
        mask: where the mask goes.
        camera_out: where the virtual camera goes.
        overwrite: whether existing files may be replaced.
        as_json: whether to print JSON.

    """
    from cubicfish_cli.files import write_files
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rig_pictures import body_of_rig
    from cubicfish_cli.library.rig_shots import Faces, ShotViews, body_for_photos, write_pictures
    from cubicfish_cli.undistortion.choose import ChosenView
    from cubicfish_cli.undistortion.images import check_outputs
    from cubicfish_cli.undistortion.view_files import view_files

    above = asked.ground is not None or plane.board is not None
    if plane.board is None:
        options.refuse_given("goes with --plane", {"--shot": asked.shot is not None})
    if not above:
        ways = {"--margin": plane.margin, "--pixels-per-unit": plane.pixels_a_unit}
        given = {name: value is not None for name, value in ways.items()}
        options.refuse_given("goes with --ground or --plane", given)
    elif asked.distance is not None:
        raise click.UsageError("the ground has a distance of its own: leave out --distance")
    path = options.rig_file(asked.rig)
    rig = load_rig(path)
    shots = shots_of(sources, [one.name for one in rig.cameras])
    body = body_for_photos(replace(body_of_rig(rig), distance=asked.distance), shots)
    if view.kind == "perspective" and not options.is_given("kind"):
        view = changed(view, kind="equirectangular")
    extras: list[Path] = []
    if not above and view.kind == "cube" and view.layout != "cross":
        if mask is not None or camera_out is not None:
            raise click.UsageError(
                "the faces of a rig's cube have masks and cameras beside them: leave out "
                f"{'--mask' if mask is not None else '--camera'}"
            )
        parts = {one.name: view.chosen(one.camera).views for one in body.cameras}
        work = Faces(rig, body, parts, shots, destination, overwrite=overwrite)
        with listening() as listener:
            done = work.write(rendering, listener.counting("Undistorting"))
        extras = [] if done.failures else list(work.tables)
        first = ChosenView(views=parts[body.cameras[0].name])
        side = work.faces[0].map.view.size[0]
        wrote = (
            f"{count(len(done.files), 'shot')} to {destination}: "
            f"{count(len(work.faces), 'face')} of {side}x{side} pixels each, with masks"
        )
    else:
        if above:
            views = _ground_views(rig, body, asked, plane, view, shots)
        else:
            views = dict.fromkeys(shots, view.chosen(body))
        pictures = ShotViews(body, views)
        outputs = _outputs(shots, destination)
        check_outputs(list(outputs.values()), overwrite=overwrite)
        if mask is not None or camera_out is not None:
            made = {"": pictures.only().whole_map}
            extras = write_files(
                view_files(made, mask=mask, beside=camera_out), overwrite=overwrite
            )
        with listening() as listener:
            progress = listener.counting("Undistorting")
            done = write_pictures(
                pictures, shots, outputs, rendering, progress, overwrite=overwrite
            )
        first = views[next(iter(done.files), next(iter(shots)))]
        where = f"{count(len(done.files), 'picture')} to {destination}"
        if len(done.files) == 1:
            where = str(next(iter(done.files.values()))[0])
        wrote = f"{where}: {first.describe()}"
    if as_json:
        print_json(
            {
                "model": path,
                "dry_run": False,
                "images": len(done.files),
                "files": [file for own in done.files.values() for file in own],
                "skipped": [],
                "failed": [
                    {"image": shot, "problem": str(why)} for shot, why in done.failures.items()
                ],
                "view": first.as_record() if done.files else None,
                "extra_files": extras,
            }
        )
    elif done.files:
        result(f"wrote {wrote}")
        print_wrote(extras)
    _end(done, told=as_json)


def _ground_views(
    rig: RigFile,
    body: Body,
    asked: RigOptions,
    plane: PlaneOptions,
    view: ViewOptions,
    shots: Mapping[str, Shot],
) -> dict[str, ChosenView]:
    """The ground from above, in each shot."""
    from cubicfish_cli.library.rig_shots import ground_of_board
    from cubicfish_cli.undistortion.choose import ChosenView
    from cubicfish_cli.undistortion.mosaic import Ground

    if any(view.rotate) or view.hfov_deg or view.vfov_deg or view.focal or view.fit is not None:
        raise click.UsageError(
            "the ground's picture is set by --pixels-per-unit and --margin: leave out the view's "
            "options"
        )
    if view.size is not None:
        raise click.UsageError("the ground's picture has the size that --pixels-per-unit gives it")
    if asked.ground is not None and plane.board is not None:
        raise click.UsageError("--ground and --plane say the same thing twice: leave one out")

    def chosen(ground: Ground) -> ChosenView:
        made = ground.view(body, margin=plane.margin, pixels_a_unit=plane.pixels_a_unit)
        return ChosenView(views={"": made}, unit=rig.units or "unit")

    if asked.ground is not None:
        return dict.fromkeys(shots, chosen(Ground.below(*asked.ground)))
    target, board = plane.loaded(), str(plane.board)
    if asked.shot is not None:
        ground = ground_of_board(rig, asked.shot, target, board)
        return dict.fromkeys(shots, chosen(ground))
    return {shot: chosen(ground_of_board(rig, shot, target, board)) for shot in shots}


def _outputs(shots: Mapping[str, Shot], destination: Path) -> dict[str, Path]:
    """Where the picture of each shot goes."""
    from cubicfish_cli.library.undistorting import refuse_a_file
    from cubicfish_cli.photos import shown

    if len(shots) > 1:
        refuse_a_file(destination, count(len(shots), "shot"))
    to_folder = len(shots) > 1 or destination.is_dir() or not destination.suffix
    outputs = {}
    for shot, photos in shots.items():
        first = next(iter(photos.values()))
        path = destination / f"{shot}{first.suffix}" if to_folder else destination
        for photo in photos.values():
            if path.exists() and path.samefile(photo):
                raise PhotoError(
                    f"{shown(path)} is the photo itself: choose another name or folder for OUT"
                )
        outputs[shot] = path
    return outputs


def _end(done: Done, *, told: bool) -> None:
    """End with an error when a shot failed."""
    failures, total = done.failures, len(done.files) + len(done.failures)
    if not failures:
        return
    if total == 1:
        raise next(iter(failures.values()))
    if not told:
        for shot, problem in failures.items():
            tell(f"failed: shot {shot}: {problem}")
    where = "in the JSON" if told else "above"
    raise PhotoError(
        f"{len(failures)} of {total} shots could not be done, for the reasons {where}; the others "
        "are done"
    )


def shots_of(sources: Sequence[str], cameras: Sequence[str]) -> dict[str, Shot]:
    """The shots that the user named: name -> the photo of each camera.

    A source is a folder with a folder for each camera, a camera's own folder, or a photo. Photos
    belong to the camera that their folder is called after, or their own name begins with; where
    nothing is called after a camera, sources are in the cameras' order.

    Raises:
        click.UsageError: it is not known which camera a source is of.
        PhotoError: one holds no photo.
        FitError: a camera's photos would be of one shot twice.

    """
    from cubicfish_cli.fitting.rig.shots import shots_by_name
    from cubicfish_cli.library.inputs import named_photos
    from cubicfish_cli.photos import natural_key, shown

    paths = [Path(source) for source in sources]
    inside = [path / name for path in paths for name in cameras if (path / name).is_dir()]
    if inside and len(paths) == 1:
        paths = inside
    owners = [_owner(path, cameras) for path in paths]
    if not any(owners) and len(paths) == len(cameras):
        owners = list(cameras)
    for path, owner in zip(paths, owners, strict=True):
        if owner is None:
            raise click.UsageError(
                f"which camera is {shown(path)} of? Call its folder after one of "
                f"{', '.join(cameras)}, or name one photo or folder of each, in that order"
            )
    photos: dict[str, list[Path]] = {name: [] for name in cameras}
    for path, owner in zip(paths, owners, strict=True):
        with listening() as listener:
            photos[str(owner)] += [photo.path for photo in named_photos([path], listener)]
    there = {name: own for name, own in photos.items() if own}
    if all(len(own) == 1 for own in there.values()):
        one = next(iter(there.values()))[0].stem
        return {one: {name: own[0] for name, own in there.items()}}
    if len(there) == 1:
        ((name, own),) = there.items()
        return {path.stem: {name: path} for path in own}
    matched = shots_by_name(list(there), [[str(path) for path in own] for own in there.values()])
    shots: dict[str, dict[str, Path]] = {}
    for name, index_of in zip(there, matched.photos, strict=True):
        for photo, index in index_of.items():
            shots.setdefault(matched.names[index], {})[name] = Path(photo)
    return dict(sorted(shots.items(), key=lambda item: natural_key(item[0])))


def _owner(path: Path, cameras: Sequence[str]) -> str | None:
    """The camera that a photo or a folder is called after."""
    own = path.absolute()
    called = own.name if own.is_dir() else own.parent.name
    if called in cameras:
        return called
    starts = [name for name in cameras if own.name.startswith(name)]
    return max(starts, key=len, default=None)
