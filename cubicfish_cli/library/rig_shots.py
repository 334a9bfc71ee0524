"""The photos of a rig's shots in files -> one picture per shot, or faces of cubes for splats."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CubicfishError, PhotoError, UsageError, ViewError
from cubicfish_cli.files import refuse_existing, write_files
from cubicfish_cli.fitting.rig.shots import shots_by_name
from cubicfish_cli.formats.rig_yaml import RigFile, load_rig
from cubicfish_cli.library.asked import RUN, Run, StrPath, named_photos, paths_of
from cubicfish_cli.library.rig_pictures import Face, body_of_rig, faces_of, faces_texts
from cubicfish_cli.library.undistorting import refuse_a_file
from cubicfish_cli.library.views import board_with_plane
from cubicfish_cli.listener import SILENT, Count, Listener
from cubicfish_cli.photos import decode_picture, natural_key, photo_size, read_file, shown
from cubicfish_cli.target import Target
from cubicfish_cli.undistortion.choose import ChosenView
from cubicfish_cli.undistortion.frames import camera_for_photos
from cubicfish_cli.undistortion.images import (
    Rendering,
    check_outputs,
    encode_picture,
    remap_picture,
)
from cubicfish_cli.undistortion.mosaic import Body, Ground, Mosaic, mosaic_of
from cubicfish_cli.undistortion.view import Camera, View, matrix_of_rotation
from cubicfish_cli.undistortion.view_files import mask_picture, view_files
from cubicfish_cli.wording import did_you_mean, quoted
from cubicfish_cli.words.phrases import plural

Shot = Mapping[str, Path]
"""Camera -> its photo."""


@dataclass(frozen=True, kw_only=True)
class Done:
    """What became of shots.

    Attributes:
        files: what was written, by shot.
        failures: shot -> why it could not be done.

    """

    files: Mapping[str, list[Path]]
    failures: Mapping[str, CubicfishError]


def body_for_photos(body: Body, shots: Mapping[str, Shot]) -> Body:
    """The cameras for photos of the size of each one's first, an exact rescale where it differs.

    Raises:
        ViewError: it is none.

    """
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


def ground_of_board(rig: RigFile, shot: str, target: Target, board: str) -> Ground:
    """Where a board of the target lay in a shot that the rig was calibrated from.

    Raises:
        ViewError: the rig does not know the shot, or the target has no such plane.

    """
    known = {str(one["shot"]): one for one in rig.fit.get("per_shot", [])}
    if shot not in known:
        raise ViewError(
            f"rig.yaml does not know where shot {quoted(shot)} was taken: name a shot of the "
            f"calibration with --shot ({did_you_mean(shot, sorted(known))}), or say --ground"
        )
    plane = board_with_plane(target, board)
    pose = known[shot]["rig_from_world"]
    turn = matrix_of_rotation(np.array(pose["rotation_vector"], float))
    ends = np.array([[0, 0], [plane.columns - 1, plane.rows - 1]])
    corners = np.array([plane.world_points(*end) for end in ends])
    return Ground.of_board(
        corners @ turn.T + np.array(pose["translation"], float),
        turn @ np.cross(plane.x_axis, plane.y_axis),
    )


class ShotViews:
    """A view a shot, most often the same for all."""

    def __init__(self, body: Body, views: Mapping[str, ChosenView]) -> None:
        """Prepare to show all that the body's cameras see."""
        self._body, self.views = body, views
        self._made: tuple[View, Mosaic] | None = None

    def mosaic(self, shot: str) -> Mosaic:
        """What makes the picture of a shot."""
        view = self.views[shot].first
        if self._made is None or self._made[0] != view:
            self._made = view, mosaic_of(self._body, view)
        return self._made[1]

    def only(self) -> Mosaic:
        """What makes the pictures of all shots.

        Raises:
            ViewError: their views differ.

        """
        if len({view.first for view in self.views.values()}) > 1:
            raise ViewError(
                "these shots have a mask and a virtual camera each, since their planes differ: do "
                "them one at a time"
            )
        return self.mosaic(next(iter(self.views)))


def write_pictures(
    work: ShotViews,
    shots: Mapping[str, Shot],
    outputs: Mapping[str, Path],
    rendering: Rendering,
    progress: Count,
    *,
    overwrite: bool,
) -> Done:
    """Write one picture per shot; one that fails does not stop the others.

    Args:
        work: what is rendered.
        shots: the photos.
        outputs: where the picture of each goes.
        rendering: how pixels are made.
        progress: called with shots done and all shots.
        overwrite: whether files may be replaced.

    """

    def files_of(shot: str) -> dict[Path, bytes]:
        like, pictures = _read(shots[shot])
        picture, _ = work.mosaic(shot).render(pictures, rendering)
        path = outputs[shot]
        return {path: encode_picture(path, picture, quality=rendering.quality, like=like)}

    return _each(shots, files_of, progress, overwrite=overwrite)


class Faces:
    """The faces of a cube about each camera, with masks, and where all were taken from."""

    def __init__(
        self,
        rig: RigFile,
        body: Body,
        views: Mapping[str, Mapping[str, View]],
        shots: Mapping[str, Shot],
        folder: Path,
        *,
        overwrite: bool,
    ) -> None:
        """Plan the files.

        Args:
            rig: the rig.
            body: its cameras for these photos.
            views: for each camera, name of the face -> view in its frame.
            shots: the photos.
            folder: where pictures, masks and tables go.
            overwrite: whether files may be replaced.

        Raises:
            OutputError: one exists and may not be replaced, or cannot be written.

        """
        self.faces = faces_of(body, views)
        self._shots, self._folder, self._overwrite = shots, folder, overwrite
        suffix = next(iter(next(iter(shots.values())).values())).suffix
        names = {shot: f"{shot}{suffix}" for shot in shots}
        texts = faces_texts(rig, self.faces, names)
        self.tables = {folder / name: text for name, text in texts.items()}
        self._paths = {
            (shot, face.name): (
                folder / "images" / face.name / names[shot],
                folder / "masks" / face.name / f"{names[shot]}.png",
            )
            for shot, photos in shots.items()
            for face in self.faces
            if face.camera.name in photos
        }
        planned = [path for pair in self._paths.values() for path in pair]
        check_outputs(planned, overwrite=overwrite)
        refuse_existing(*self.tables, overwrite=overwrite)

    def write(self, rendering: Rendering, progress: Count) -> Done:
        """Write them; the tables too where no shot failed."""
        masks = {
            face.name: encode_picture(Path("mask.png"), mask_picture(face.map.valid))
            for face in self.faces
        }

        def files_of(shot: str) -> dict[Path, bytes]:
            like, pictures = _read(self._shots[shot])
            files = {}
            for face in self.faces:
                if face.camera.name in pictures:
                    path, mask = self._paths[shot, face.name]
                    part = _rendered(face, pictures, rendering)
                    files[path] = encode_picture(path, part, quality=rendering.quality, like=like)
                    files[mask] = masks[face.name]
            return files

        done = _each(self._shots, files_of, progress, overwrite=self._overwrite)
        if not done.failures:
            write_files(self.tables, overwrite=self._overwrite)
        return done


def _rendered(face: Face, pictures: Mapping[str, Any], rendering: Rendering) -> Any:
    try:
        return remap_picture(pictures[face.camera.name], face.map, rendering)
    except ViewError as problem:
        raise ViewError(f"camera {face.camera.name}: {problem}") from problem


def _each(
    shots: Mapping[str, Shot],
    files_of: Callable[[str], Mapping[Path, bytes]],
    progress: Count,
    *,
    overwrite: bool,
) -> Done:
    done: dict[str, list[Path]] = {}
    failures: dict[str, CubicfishError] = {}
    for number, shot in enumerate(shots, start=1):
        try:
            done[shot] = write_files(files_of(shot), overwrite=overwrite)
        except CubicfishError as problem:
            failures[shot] = problem
        progress(number, len(shots))
    return Done(files=done, failures=failures)


def _read(photos: Shot) -> tuple[bytes, dict[str, Any]]:
    """The photos of a shot, and the first one's file as it is."""
    data = {name: read_file(path) for name, path in photos.items()}
    pictures = {
        name: decode_picture(photos[name], content, floats=True) for name, content in data.items()
    }
    return next(iter(data.values())), pictures


@dataclass(frozen=True, kw_only=True)
class PlaneOfGround:
    """The ground that shots are shown from above on.

    Attributes:
        below: how far below the first camera it is, and by how much that looks up and is rolled.
        board: a target, and which of its boards lies on it instead.
        shot: which shot of the calibration says where that lies; None for each shot itself.
        margin: how far the picture goes on beyond what is seen or the board.
        pixels_per_unit: its scale.

    """

    below: tuple[float, float, float] = (0.0, 0.0, 0.0)
    board: tuple[Target, str] | None = None
    shot: str | None = None
    margin: float | None = None
    pixels_per_unit: float | None = None

    def views(self, rig: RigFile, body: Body, shots: Iterable[str]) -> dict[str, ChosenView]:
        """The ground in each shot.

        Raises:
            ViewError: it is not known where the board lay, or nothing is seen.

        """

        def chosen(shot: str | None) -> ChosenView:
            if self.board is not None:
                ground = ground_of_board(rig, str(shot), *self.board)
            else:
                ground = Ground.below(*self.below)
            view = ground.view(body, margin=self.margin, pixels_a_unit=self.pixels_per_unit)
            return ChosenView(views={"": view}, unit=rig.units or "unit")

        if self.board is None or self.shot is not None:
            return dict.fromkeys(shots, chosen(self.shot))
        return {shot: chosen(shot) for shot in shots}


@dataclass(frozen=True, kw_only=True)
class ShotFiles:
    """What became of :func:`undistort_shots`.

    Attributes:
        model: the rig's file.
        done: what was written of each shot, and what was not.
        view: what the first shot's picture shows, or the first camera's faces.
        extras: masks, virtual cameras and tables that were written.
        faces: the faces about each camera; none where a shot is one picture.

    """

    model: Path
    done: Done
    view: ChosenView
    extras: Sequence[Path]
    faces: Sequence[Face] = ()

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        done = self.done
        return {
            "model": self.model,
            "dry_run": False,
            "images": len(done.files),
            "files": [file for own in done.files.values() for file in own],
            "skipped": [],
            "failed": [{"image": shot, "problem": str(why)} for shot, why in done.failures.items()],
            "view": self.view.as_record() if done.files else None,
            "extra_files": self.extras,
        }


def undistort_shots(
    rig: Path,
    sources: Sequence[StrPath],
    destination: Path,
    choose: Callable[[Camera], ChosenView],
    rendering: Rendering,
    run: Run = RUN,
    *,
    faces: bool = False,
    ground: PlaneOfGround | None = None,
    distance: float | None = None,
    mask: Path | None = None,
    camera_out: Path | None = None,
) -> ShotFiles:
    """Make a picture of every shot of a rig, as ``cubicfish undistort --rig`` does.

    Args:
        rig: its file.
        sources: photos, or folders of them; see :func:`shots_of`.
        destination: the picture of one shot, or the folder of several.
        choose: all cameras as one, or each camera -> what is rendered.
        rendering: how pixels are made.
        run: how the work is done.
        faces: whether each camera has pictures of its own, with masks.
        ground: shows that from above instead.
        distance: how far away things are that pictures join at; None for far away.
        mask: also writes where the result may be trusted.
        camera_out: also writes the virtual camera of the result.

    Raises:
        UsageError: it is not known which camera a photo is of.
        CubicfishError: the rig or all photos cannot be used, or a file exists and may not be
            replaced.

    """
    loaded, overwrite = load_rig(rig), run.overwrite
    shots = shots_of(sources, [one.name for one in loaded.cameras], run.listener)
    body = body_for_photos(replace(body_of_rig(loaded), distance=distance), shots)
    if faces:
        parts = {one.name: choose(one.camera).views for one in body.cameras}
        work = Faces(loaded, body, parts, shots, destination, overwrite=overwrite)
        done = work.write(rendering, run.listener.counting("Undistorting"))
        return ShotFiles(
            model=rig,
            done=done,
            view=ChosenView(views=parts[body.cameras[0].name]),
            extras=[] if done.failures else list(work.tables),
            faces=work.faces,
        )
    if ground is not None:
        views = ground.views(loaded, body, shots)
    else:
        views = dict.fromkeys(shots, choose(body))
    pictures = ShotViews(body, views)
    outputs = _outputs(shots, destination)
    check_outputs(list(outputs.values()), overwrite=overwrite)
    extras: list[Path] = []
    if mask is not None or camera_out is not None:
        made = {"": pictures.only().whole_map}
        extras = write_files(view_files(made, mask=mask, beside=camera_out), overwrite=overwrite)
    progress = run.listener.counting("Undistorting")
    done = write_pictures(pictures, shots, outputs, rendering, progress, overwrite=overwrite)
    first = views[next(iter(done.files), next(iter(shots)))]
    return ShotFiles(model=rig, done=done, view=first, extras=extras)


def _outputs(shots: Mapping[str, Shot], destination: Path) -> dict[str, Path]:
    """Where the picture of each shot goes."""
    if len(shots) > 1:
        refuse_a_file(destination, plural(len(shots), "shot"))
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


def shots_of(
    sources: Sequence[StrPath], cameras: Sequence[str], listener: Listener = SILENT
) -> dict[str, Shot]:
    """The shots that the user named: name -> the photo of each camera.

    A source is a folder with a folder for each camera, a camera's own folder, or a photo. Photos
    belong to the camera that their folder is called after, or their own name begins with; where
    nothing is called after a camera, sources are in the cameras' order.

    Raises:
        UsageError: it is not known which camera a source is of.
        PhotoError: one holds no photo.
        FitError: a camera's photos would be of one shot twice.

    """
    paths = paths_of(sources)
    inside = [path / name for path in paths for name in cameras if (path / name).is_dir()]
    if inside and len(paths) == 1:
        paths = inside
    owners = [_owner(path, cameras) for path in paths]
    if not any(owners) and len(paths) == len(cameras):
        owners = list(cameras)
    for path, owner in zip(paths, owners, strict=True):
        if owner is None:
            raise UsageError(
                f"which camera is {shown(path)} of? Call its folder after one of "
                f"{', '.join(cameras)}, or name one photo or folder of each, in that order"
            )
    photos: dict[str, list[Path]] = {name: [] for name in cameras}
    for path, owner in zip(paths, owners, strict=True):
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
