"""The photos of a rig's shots in files -> one picture per shot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import CubicfishError, UsageError, ViewError
from cubicfish_cli.files import write_files
from cubicfish_cli.fitting.rig.shots import shots_by_name
from cubicfish_cli.formats.rig_yaml import load_rig
from cubicfish_cli.library.asked import (
    RUN,
    Run,
    StrPath,
    named_photos,
    path_or_none,
    paths_of,
    rig_file_in,
)
from cubicfish_cli.library.rig_pictures import body_of_rig
from cubicfish_cli.library.undistorting import (
    Interpolation,
    UndistortedFiles,
    is_folder,
    refuse_itself,
)
from cubicfish_cli.listener import SILENT, Listener
from cubicfish_cli.photos import decode_picture, natural_key, photo_size, read_file, shown
from cubicfish_cli.undistortion.choose import chosen_view
from cubicfish_cli.undistortion.images import Rendering, check_outputs, encode_picture
from cubicfish_cli.undistortion.map_formats import view_files
from cubicfish_cli.undistortion.maps import camera_for_photos
from cubicfish_cli.undistortion.options import ViewOptions
from cubicfish_cli.undistortion.rigs import Body, mosaic_of
from cubicfish_cli.undistortion.view import View
from cubicfish_cli.words.phrases import plural

Shot = Mapping[str, Path]
"""Camera -> its photo."""


Became = tuple[dict[str, list[Path]], dict[str, CubicfishError]]
"""What was written of each shot, and why others could not be done."""


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


def _pictures(
    body: Body,
    view: View,
    shots: Mapping[str, Shot],
    outputs: Mapping[str, Path],
    rendering: Rendering,
    run: Run,
    *,
    mask: Path | None,
    beside: Path | None,
) -> tuple[Became, list[Path]]:
    """Write one picture per shot, and the mask and the virtual camera of all.

    Raises:
        OutputError: one exists and may not be replaced, or cannot be written.

    """
    mosaic = mosaic_of(body, view)
    check_outputs(list(outputs.values()), overwrite=run.overwrite)
    extras: list[Path] = []
    if mask is not None or beside is not None:
        files = view_files({"": mosaic.whole_map}, mask=mask, beside=beside)
        extras = write_files(files, overwrite=run.overwrite)

    def files_of(shot: str) -> dict[Path, bytes]:
        like, pictures = _read(shots[shot])
        picture, _ = mosaic.render(pictures, rendering)
        path = outputs[shot]
        return {path: encode_picture(path, picture, quality=rendering.quality, like=like)}

    return _each(shots, files_of, run), extras


def _each(
    shots: Iterable[str], files_of: Callable[[str], Mapping[Path, bytes]], run: Run
) -> Became:
    """Write the files of each shot; one that fails does not stop the others."""
    done: dict[str, list[Path]] = {}
    failures: dict[str, CubicfishError] = {}
    progress, every = run.listener.counting("Undistorting"), list(shots)
    for number, shot in enumerate(every, start=1):
        try:
            done[shot] = write_files(files_of(shot), overwrite=run.overwrite)
        except CubicfishError as problem:
            failures[shot] = problem
        progress(number, len(every))
    return done, failures


def _read(photos: Shot) -> tuple[bytes, dict[str, Any]]:
    """The photos of a shot, and the first one's file as it is."""
    data = {name: read_file(path) for name, path in photos.items()}
    pictures = {
        name: decode_picture(photos[name], content, floats=True) for name, content in data.items()
    }
    return next(iter(data.values())), pictures


def undistort_rig_files(
    photos: StrPath | Sequence[StrPath],
    output: StrPath,
    rig: StrPath,
    view: View | ViewOptions | None = None,
    *,
    distance: float | None = None,
    interpolation: Interpolation = "linear",
    quality: int | None = None,
    mask: StrPath | None = None,
    virtual_camera: StrPath | None = None,
    run: Run = RUN,
) -> UndistortedFiles:
    """Make a picture of every shot of a rig, as ``cubicfish undistort --rig`` does.

    Args:
        photos: photos, or folders of them. They are of the camera that their folder is called
            after, or that their own name begins with; where nothing is called after a camera,
            they are in the cameras' order.
        output: a folder; of one shot also a name for its picture.
        rig: its file, or the folder of that.
        view: what to show in the frame of the rig, or what is asked of it; by default all around,
            as longitude and latitude.
        distance: how far away things are that the cameras' pictures join at, in the rig's unit;
            None for far away.
        interpolation: how pixels are blended.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photos.
        mask: also writes where the results may be trusted: 255, and 0 elsewhere.
        virtual_camera: also writes the camera of the results, as :func:`undistort_files`.
        run: how the work is done.

    Returns:
        The ``files`` that were written, and what ``failed`` and why, by the shots' names.

    Raises:
        UsageError: it is not known which camera a photo is of, or what is asked does not go
            together.
        OutputError: a result exists and may not be replaced, or would replace a photo.
        CubicfishError: the rig or all photos cannot be used.

    """
    rendering = Rendering(interpolation=interpolation, quality=quality)
    if view is None or (isinstance(view, ViewOptions) and view.kind is None):
        view = replace(view or ViewOptions(), kind="equirectangular")
    if isinstance(view, ViewOptions) and view.parts != ("",):
        raise UsageError("a shot of a rig becomes one picture: choose another --view than cube")
    path, goal = rig_file_in(Path(rig)), Path(output)
    loaded = load_rig(path)
    shots = shots_of(paths_of(photos), [one.name for one in loaded.cameras], run.listener)
    body = body_for_photos(replace(body_of_rig(loaded), distance=distance), shots)
    chosen = chosen_view(body, view)
    (written, failures), extras = _pictures(
        body,
        chosen.first,
        shots,
        _outputs(shots, goal),
        rendering,
        run,
        mask=path_or_none(mask),
        beside=path_or_none(virtual_camera),
    )
    return UndistortedFiles(
        kind="shot",
        output=goal,
        written=written,
        failures=failures,
        model=path,
        view=chosen if written else None,
        extras=extras,
    )


def _outputs(shots: Mapping[str, Shot], output: Path) -> dict[str, Path]:
    """Where the picture of each shot goes."""
    to_folder = is_folder(output, plural(len(shots), "shot") if len(shots) > 1 else "")
    outputs = {}
    for shot, photos in shots.items():
        first = next(iter(photos.values()))
        outputs[shot] = output / f"{shot}{first.suffix}" if to_folder else output
        refuse_itself([outputs[shot]], list(photos.values()))
    return outputs


def shots_of(
    sources: Sequence[Path], cameras: Sequence[str], listener: Listener = SILENT
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
    inside = [path / name for path in sources for name in cameras if (path / name).is_dir()]
    paths = inside if inside and len(sources) == 1 else list(sources)
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
