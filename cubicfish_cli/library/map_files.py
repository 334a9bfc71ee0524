"""Undistortion maps of a camera, or of two cameras of a rig, in files for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from cubicfish_cli.errors import CameraFileError, UsageError
from cubicfish_cli.files import Content, refuse_existing, write_files
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.formats.rig_yaml import RigFile, load_rig
from cubicfish_cli.library.asked import StrPath, in_folder
from cubicfish_cli.library.rig_pictures import pair_maps
from cubicfish_cli.library.views import TrustedWithin
from cubicfish_cli.plain_yaml import plain_yaml_text
from cubicfish_cli.undistortion.choose import ChosenView, SeenField
from cubicfish_cli.undistortion.frames import Crop, camera_for_photos
from cubicfish_cli.undistortion.map_formats import build_redistort_map, ffmpeg_command, map_writer
from cubicfish_cli.undistortion.maps import UndistortMap, build_map
from cubicfish_cli.undistortion.view import Camera
from cubicfish_cli.undistortion.view_files import part_name, view_files

SUFFIXES = (".npz", ".exr", ".png", ".pgm")

Size = tuple[int, int]
Origin = Literal["bottom-left", "top-left"]


@dataclass(frozen=True, kw_only=True)
class MapFormat:
    """How maps are written.

    Attributes:
        output: what their files are called; its suffix says which format.
        fixed_point: whether .npz has the fixed-point maps of cv2.convertMaps.
        origin: where y of an STMap is 0.
        overwrite: whether files may be replaced.

    """

    output: Path
    fixed_point: bool = False
    origin: Origin = "bottom-left"
    overwrite: bool = False

    def __post_init__(self) -> None:
        suffix = self.output.suffix.lower()
        if suffix not in SUFFIXES:
            raise UsageError(
                f"{self.output}: maps are written as {', '.join(SUFFIXES)}: choose a name that "
                "ends so"
            )
        if self.fixed_point and suffix != ".npz":
            raise UsageError("--fixed-point is for maps in .npz")

    def plan(self, parts: Sequence[str]) -> dict[str, Any]:
        """The files of each part of a map, and what writes them; refused where they exist."""
        return {
            part: map_writer(
                part_name(self.output, part), fixed_point=self.fixed_point, origin=self.origin
            )
            for part in parts
        }

    def write(
        self,
        plan: Mapping[str, Any],
        maps: Mapping[str, UndistortMap],
        mask: Path | None,
        more: Mapping[Path, Content],
        masked: Callable[[UndistortMap], Any] | None = None,
    ) -> list[Path]:
        """Write maps, their views and what more there is, all or none."""
        files: dict[Path, Content] = {
            path: partial(write, index, maps[part])
            for part, (paths, write) in plan.items()
            for index, path in enumerate(paths)
        }
        files |= {**more, **view_files(maps, mask=mask, beside=self.output, masked=masked)}
        return write_files(files, overwrite=self.overwrite)


@dataclass(frozen=True, kw_only=True)
class MapFiles:
    """What became of :func:`map_files` and :func:`pair_map_files`.

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
            "model": str(self.model),
            "files": self.own,
            "extra_files": [path for path in self.written if path not in self.own],
            "image_size": self.image_size,
            "view": self.view.as_record(),
            **({} if self.stereo is None else {"stereo": self.stereo}),
            "ffmpeg": self.ffmpeg,
        }


def map_files(
    camera: StrPath,
    form: MapFormat,
    choose: Callable[[Camera], ChosenView],
    *,
    parts: Sequence[str] = ("",),
    photo_size: Size | None = None,
    crop: Crop | None = None,
    redistort: bool = False,
    mask: Path | None = None,
    mask_limit: float | None = None,
) -> MapFiles:
    """Write the map of a camera, as ``cubicfish map`` does.

    Args:
        camera: its file.
        form: how maps are written.
        choose: the camera of the photos -> what the map shows.
        parts: the names of the parts of that.
        photo_size: (width, height) of photos, an exact rescale of the calibrated ones.
        crop: the part of the calibrated photo that photos show.
        redistort: whether the map is the way back.
        mask: also writes where the map may be trusted.
        mask_limit: only where the camera's own uncertainty is at most so many pixels.

    Raises:
        CubicfishError: the camera cannot be used, there is no such view, or a file exists and may
            not be replaced.

    """
    plan = form.plan(parts)
    own = [path for paths, _ in plan.values() for path in paths]
    refuse_existing(*own, overwrite=form.overwrite)
    path = in_folder(Path(camera))
    loaded = load_camera(path)
    size = photo_size or ((crop.width, crop.height) if crop else loaded.camera.image_size)
    there = camera_for_photos(loaded.camera, size, crop)
    masked = None
    if mask_limit is not None:
        masked = partial(TrustedWithin(mask_limit, loaded, path, crop).mask, size=size)
    view = choose(there)
    build = build_redistort_map if redistort else build_map
    maps = {part: build(there, one) for part, one in view.views.items()}
    written = form.write(plan, maps, mask, {}, masked)
    is_pair = form.output.suffix.lower() == ".pgm"
    return MapFiles(
        model=path,
        own=own,
        written=written,
        image_size=size,
        view=view,
        seen=None if redistort else view.seen_by(there),
        ffmpeg=[ffmpeg_command(*paths) for paths, _ in plan.values()] if is_pair else [],
    )


def pair_map_files(
    rig: Path,
    form: MapFormat,
    choose: Callable[[Camera], ChosenView],
    *,
    pair: tuple[str, str] | None = None,
    photo_size: Size | None = None,
    whole_field: bool = False,
    mask: Path | None = None,
) -> MapFiles:
    """Write a map for each of two cameras of a rig, and what it takes to measure with them.

    Args:
        rig: its file.
        form: how maps are written; what they are called, before the cameras' names.
        choose: the two as one camera -> one central view whose rows both can share.
        pair: names of its cameras; None for a rig of two.
        photo_size: of the photos, where it is not the calibrated one.
        whole_field: whether the view is cut to what the two see.
        mask: where the masks go.

    Raises:
        CubicfishError: the rig cannot be used, or has no such cameras; the two see nothing in
            common; a file exists and may not be replaced.

    """
    loaded = load_rig(rig)
    both = _two_cameras(loaded, pair)
    plan = form.plan(both)
    about = form.output.with_suffix(".stereo.yaml")
    own = [path for paths, _ in plan.values() for path in paths]
    refuse_existing(*own, about, overwrite=form.overwrite)
    made = pair_maps(loaded, *both, choose, photo_size=photo_size, whole_field=whole_field)
    written = form.write(plan, made.maps, mask, {about: plain_yaml_text(made.record)})
    return MapFiles(
        model=rig,
        own=own,
        written=written,
        image_size=made.pair.image_size,
        view=made.chosen,
        stereo=made.record,
    )


def _two_cameras(rig: RigFile, pair: tuple[str, str] | None) -> tuple[str, str]:
    """Names of the cameras that are named, or of those of a rig of two."""
    if pair is not None:
        return rig.camera(pair[0]).name, rig.camera(pair[1]).name
    names = [one.name for one in rig.cameras]
    if len(names) != 2:
        raise CameraFileError(f"name two of the rig's cameras with --pair: {', '.join(names)}")
    return names[0], names[1]
