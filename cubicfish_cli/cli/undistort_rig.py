"""``cubicfish undistort --rig``: the photos of a shot to one picture, or to faces for splats."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.rig_shots import Shot, shots_of
from cubicfish_cli.cli.terminal import print_json, progress, result, tell
from cubicfish_cli.cli.view_options import ChosenView, ViewOptions
from cubicfish_cli.cli.view_outputs import view_writers, write_all
from cubicfish_cli.errors import CubicfishError, PhotoError, ViewError
from cubicfish_cli.wording import did_you_mean, quoted

if TYPE_CHECKING:
    from cubicfish_cli.cli.chosen_views import PlaneOptions
    from cubicfish_cli.cli.rig_options import RigOptions
    from cubicfish_cli.formats.rig_yaml import RigFile
    from cubicfish_cli.undistortion.ground import Ground
    from cubicfish_cli.undistortion.images import Rendering
    from cubicfish_cli.undistortion.mosaic import Body, Mosaic


def undistort_rig(
    sources: Sequence[str],
    destination: Path,
    rig_options: RigOptions,
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
        rig_options: the rig, and what was asked of it.
        view: what was asked of the picture.
        plane: what was asked of a plane.
        rendering: how pixels are made.
        mask: where the mask goes.
        camera_out: where the virtual camera goes.
        overwrite: whether existing files may be replaced.
        as_json: whether to print JSON.

    """
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rig_pictures import body_of_rig

    above = rig_options.ground is not None or plane.board is not None
    for name, given, needs, there in (
        ("--shot", rig_options.shot, "--plane", plane.board is not None),
        ("--margin", plane.margin, "--ground or --plane", above),
        ("--pixels-per-unit", plane.pixels_a_unit, "--ground or --plane", above),
    ):
        if given is not None and not there:
            raise click.UsageError(f"{name} goes with {needs}")
    if above and rig_options.distance is not None:
        raise click.UsageError("the ground has a distance of its own: leave out --distance")
    path = options.rig_file(rig_options.rig)
    rig = load_rig(path)
    shots = shots_of(sources, [one.name for one in rig.cameras])
    body = _for_photos(replace(body_of_rig(rig), distance=rig_options.distance), shots)
    asked = click.get_current_context().get_parameter_source("kind")
    if view.kind == "perspective" and asked is not ParameterSource.COMMANDLINE:
        view = replace(view, kind="equirectangular")
    if above:
        work = _Views(body, _ground_views(rig, body, rig_options, plane, view, shots))
    elif view.kind == "cube" and view.layout != "cross":
        if mask is not None or camera_out is not None:
            raise click.UsageError(
                "the faces of a rig's cube have masks and cameras beside them: leave out "
                f"{'--mask' if mask is not None else '--camera'}"
            )
        _faces(rig, body, view, shots, destination, rendering, path, overwrite, as_json)
        return
    else:
        chosen = view.chosen(body)
        work = _Views(body, dict.fromkeys(shots, chosen))
    _pictures(work, shots, destination, rendering, path, mask, camera_out, overwrite, as_json)


def _for_photos(body: Body, shots: Mapping[str, Shot]) -> Body:
    """The cameras for photos of the size of each one's first, an exact rescale where it differs."""
    from cubicfish_cli.photos import photo_size
    from cubicfish_cli.undistortion.frames import camera_for_photos

    cameras = []
    for one in body.cameras:
        first = next((photos[one.name] for photos in shots.values() if one.name in photos), None)
        if first is not None:
            try:
                one = replace(one, camera=camera_for_photos(one.camera, photo_size(first)))
            except ViewError as problem:
                raise ViewError(f"camera {one.name}: {problem}") from problem
        cameras.append(one)
    return replace(body, cameras=tuple(cameras))


class _Views:
    """A view a shot, most often the same for all."""

    def __init__(self, body: Body, views: Mapping[str, ChosenView]) -> None:
        self._body, self.views = body, views
        self._made: tuple[Any, Mosaic] | None = None

    def mosaic(self, shot: str) -> Mosaic:
        from cubicfish_cli.undistortion.mosaic import mosaic_of

        view = self.views[shot].first
        if self._made is None or self._made[0] != view:
            self._made = view, mosaic_of(self._body, view)
        return self._made[1]


def _ground_views(
    rig: RigFile,
    body: Body,
    asked: RigOptions,
    plane: PlaneOptions,
    view: ViewOptions,
    shots: Mapping[str, Shot],
) -> dict[str, ChosenView]:
    """The ground from above, in each shot."""
    from cubicfish_cli.undistortion.ground import Ground

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
    known = {str(one["shot"]): one for one in rig.fit.get("per_shot", [])}
    if asked.shot is not None:
        return dict.fromkeys(shots, chosen(_board_ground(known, asked.shot, plane)))
    return {shot: chosen(_board_ground(known, shot, plane)) for shot in shots}


def _board_ground(known: Mapping[str, Mapping[str, Any]], shot: str, plane: PlaneOptions) -> Ground:
    import numpy as np

    from cubicfish_cli.cli.target_choice import target_path
    from cubicfish_cli.library.planes import board_with_plane
    from cubicfish_cli.target import load_target
    from cubicfish_cli.undistortion.ground import Ground
    from cubicfish_cli.undistortion.view import matrix_of_rotation

    if shot not in known:
        raise ViewError(
            f"rig.yaml does not know where shot {quoted(shot)} was taken: name a shot of the "
            f"calibration with --shot ({did_you_mean(shot, sorted(known))}), or say --ground"
        )
    target = target_path(plane.target)
    if target is None:
        raise click.UsageError("--plane needs the target: name it with --target target.yaml")
    board = board_with_plane(load_target(target), str(plane.board))
    pose = known[shot]["rig_from_world"]
    turn = matrix_of_rotation(np.array(pose["rotation_vector"], float))
    ends = np.array([[0, 0], [board.columns - 1, board.rows - 1]])
    corners = np.array([board.world_points(*end) for end in ends])
    return Ground.of_board(
        corners @ turn.T + np.array(pose["translation"], float),
        turn @ np.cross(board.x_axis, board.y_axis),
    )


def _pictures(
    work: _Views,
    shots: Mapping[str, Shot],
    destination: Path,
    rendering: Rendering,
    rig: Path,
    mask: Path | None,
    camera_out: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """One picture a shot."""
    from cubicfish_cli.undistortion.images import check_outputs, encode_picture, write_files

    outputs = _outputs(shots, destination)
    check_outputs(list(outputs.values()), overwrite=overwrite)
    extras: list[Path] = []
    if mask is not None or camera_out is not None:
        if len({view.first for view in work.views.values()}) > 1:
            raise ViewError(
                "these shots have a mask and a virtual camera each, since their planes differ: do "
                "them one at a time"
            )
        made = work.mosaic(next(iter(shots))).whole_map
        extras = write_all(
            view_writers({"": made}, mask=mask, beside=camera_out), overwrite=overwrite
        )
    failures: dict[str, CubicfishError] = {}
    with progress("Undistorting") as callback:
        for number, (shot, photos) in enumerate(shots.items()):
            try:
                data, pictures = _read(photos)
                picture, _ = work.mosaic(shot).render(pictures, rendering)
                content = encode_picture(
                    outputs[shot], picture, quality=rendering.quality, like=data
                )
                write_files({outputs[shot]: content}, overwrite=overwrite)
            except CubicfishError as problem:
                failures[shot] = problem
            callback(number + 1, len(shots))
    done = {shot: path for shot, path in outputs.items() if shot not in failures}
    first = work.views[next(iter(done))] if done else None
    if as_json:
        print_json(_record(rig, done, failures, first, extras))
    elif first is not None:
        if len(done) == 1:
            result(f"wrote {next(iter(done.values()))}: {first.describe()}")
        else:
            result(f"wrote {count(len(done), 'picture')} to {destination}: {first.describe()}")
        for path in extras:
            result(f"wrote {path}")
    _end(failures, len(shots), told=as_json)


def _faces(
    rig: RigFile,
    body: Body,
    view: ViewOptions,
    shots: Mapping[str, Shot],
    destination: Path,
    rendering: Rendering,
    rig_path: Path,
    overwrite: bool,
    as_json: bool,
) -> None:
    """The faces of a cube about each camera, with masks, and where all were taken from."""
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.library.rig_pictures import faces_of, faces_texts
    from cubicfish_cli.undistortion.images import (
        check_outputs,
        encode_picture,
        remap_picture,
        write_files,
    )
    from cubicfish_cli.undistortion.view_files import mask_picture

    suffix = next(iter(next(iter(shots.values())).values())).suffix
    views = {one.name: view.chosen(one.camera).views for one in body.cameras}
    faces = faces_of(body, views)
    names = {shot: f"{shot}{suffix}" for shot in shots}
    images, masks = destination / "images", destination / "masks"
    tables = {
        destination / name: text.encode() for name, text in faces_texts(rig, faces, names).items()
    }
    planned = [
        images / face.name / names[shot]
        for shot, photos in shots.items()
        for face in faces
        if face.camera.name in photos
    ]
    beside = [masks / path.parent.name / f"{path.name}.png" for path in planned]
    check_outputs([*planned, *beside], overwrite=overwrite)
    for path in tables:
        refuse_existing(path, overwrite=overwrite)
    masks_of = {
        face.name: encode_picture(Path("mask.png"), mask_picture(face.map.valid)) for face in faces
    }
    failures: dict[str, CubicfishError] = {}
    done: dict[str, Path] = {}
    with progress("Undistorting") as callback:
        for number, (shot, photos) in enumerate(shots.items()):
            try:
                data, pictures = _read(photos)
                files = {}
                for face in faces:
                    if face.camera.name not in pictures:
                        continue
                    try:
                        part = remap_picture(pictures[face.camera.name], face.map, rendering)
                    except ViewError as problem:
                        raise ViewError(f"camera {face.camera.name}: {problem}") from problem
                    path = images / face.name / names[shot]
                    files[path] = encode_picture(path, part, quality=rendering.quality, like=data)
                    files[masks / face.name / f"{names[shot]}.png"] = masks_of[face.name]
                write_files(files, overwrite=overwrite)
                done |= {f"{shot} {path}": path for path in files}
            except CubicfishError as problem:
                failures[shot] = problem
            callback(number + 1, len(shots))
    if not failures:
        write_files(tables, overwrite=overwrite)
    first = ChosenView(views=dict(views[body.cameras[0].name])) if done else None
    extras = [] if failures else list(tables)
    if as_json:
        print_json(_record(rig_path, done, failures, first, extras, len(shots) - len(failures)))
    else:
        side = faces[0].map.view.size[0]
        if done:
            result(
                f"wrote {count(len(shots) - len(failures), 'shot')} to {destination}: "
                f"{count(len(faces), 'face')} of {side}x{side} pixels each, with masks"
            )
        for path in extras:
            result(f"wrote {path}")
    _end(failures, len(shots), told=as_json)


def _read(photos: Shot) -> tuple[bytes, dict[str, Any]]:
    """The photos of a shot, and the first one's file as it is."""
    from cubicfish_cli.photos import decode_picture, read_file

    data = {name: read_file(path) for name, path in photos.items()}
    pictures = {
        name: decode_picture(photos[name], content, floats=True) for name, content in data.items()
    }
    return next(iter(data.values())), pictures


def _outputs(shots: Mapping[str, Shot], destination: Path) -> dict[str, Path]:
    """Where the picture of each shot goes."""
    from cubicfish_cli.photos import SUFFIXES, shown

    a_file = destination.suffix.lower() in SUFFIXES
    if len(shots) > 1 and a_file and not destination.is_dir():
        raise click.UsageError(
            f"{shown(destination)} is the name of one file, and {count(len(shots), 'shot')} become "
            f"a folder: write {shown(destination.with_suffix(''))}{os.sep}"
        )
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


def _record(
    rig: Path,
    done: Mapping[str, Path],
    failures: Mapping[str, CubicfishError],
    view: ChosenView | None,
    extras: Sequence[Path],
    shots: int | None = None,
) -> dict[str, Any]:
    """What was done, as plain data for JSON."""
    return {
        "model": str(rig),
        "dry_run": False,
        "images": len(done) if shots is None else shots,
        "files": [str(path) for path in done.values()],
        "skipped": [],
        "failed": [{"image": shot, "problem": str(why)} for shot, why in failures.items()],
        "view": view and view.as_record(),
        "extra_files": [str(path) for path in extras],
    }


def _end(failures: Mapping[str, CubicfishError], total: int, *, told: bool) -> None:
    """End with an error when a shot failed."""
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
