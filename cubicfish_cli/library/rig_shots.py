"""The photos of a rig's shots in files -> one picture per shot, or faces of cubes for splats."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CubicfishError, ViewError
from cubicfish_cli.files import refuse_existing, write_files
from cubicfish_cli.formats.rig_yaml import RigFile
from cubicfish_cli.library.rig_pictures import Face, faces_of, faces_texts
from cubicfish_cli.library.views import board_with_plane
from cubicfish_cli.photos import decode_picture, photo_size, read_file
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
from cubicfish_cli.undistortion.view import View, matrix_of_rotation
from cubicfish_cli.undistortion.view_files import mask_picture
from cubicfish_cli.wording import did_you_mean, quoted

Shot = Mapping[str, Path]
"""Camera -> its photo."""

Count = Callable[[int, int], None]


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
