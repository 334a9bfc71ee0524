"""Photos of known truth, with that truth beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.errors import CameraFileError, CorrespondenceError, OutputError, UsageError
from cubicfish_cli.files import Content, write_files
from cubicfish_cli.formats.calibrated import Calibrated, camera_text
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.formats.foreign import is_foreign, read_foreign
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import RUN, Run, StrPath, target_in
from cubicfish_cli.observations import MAX_SIDE
from cubicfish_cli.rendering.options import FORMATS, LookOptions
from cubicfish_cli.rendering.simulate import (
    chosen_poses,
    photo_bytes,
    simulated_photos,
)
from cubicfish_cli.rendering.truth import (
    Pose,
    load_poses,
    pose_table_text,
    true_corners_text,
)
from cubicfish_cli.rendering.views import NearLens, WholeLens
from cubicfish_cli.target import Target
from cubicfish_cli.wording import did_you_mean, quoted
from cubicfish_cli.words.codes import Event
from cubicfish_cli.words.phrases import plural

_SUFFIXES = {"true_corners": ".csv", "true_poses": ".csv", "true_camera": ".yaml"}
_LOOK = LookOptions()
_MOST_PHOTOS = 10_000
_RENDERING = "Rendering"


@dataclass(frozen=True, kw_only=True)
class Source:
    """What photos are taken with.

    Attributes:
        lens: the true lens.
        image_size: (width, height) of the photos.
        text: what true_camera.yaml holds.
        note: of which tool's lens that is the nearest camera, and how near; None if it is that.

    """

    lens: WholeLens
    image_size: tuple[int, int]
    text: str
    note: Mapping[str, Any] | None = None


def _source(
    lens: Calibrated | CubicCamera | StrPath, image_size: Sequence[int] | None, target: Target
) -> Source:
    """What a caller names: a camera, a lens or a file of one; see :func:`simulate_files`.

    Raises:
        CameraFileError: it cannot be used, or is for photos of another size.

    """
    size = None
    if image_size is not None:
        size = Refusal(error=CameraFileError).size(image_size, "image_size", limit=MAX_SIDE)
    if isinstance(lens, Calibrated | CubicCamera):
        camera = lens.camera if isinstance(lens, Calibrated) else lens
        source = _of_camera(camera, {}, target)
    elif is_foreign(Path(lens)):
        source = _of_another_tool(Path(lens), size)
    else:
        source = _of_camera(load_camera(Path(lens)).camera, {"camera": str(lens)}, target)
    if size not in (None, source.image_size):
        raise CameraFileError(
            "the lens is for photos of {}x{} pixels: leave image_size out".format(
                *source.image_size
            )
        )
    return source


def _of_camera(camera: CubicCamera, made_by: Mapping[str, object], target: Target) -> Source:
    """A camera, which sees the target as near as it is."""
    camera = camera.in_units(target.units)
    lens = NearLens(camera=camera) if camera.pupil_travel else camera
    return Source(lens=lens, image_size=camera.image_size, text=_camera_text(camera, made_by))


def _of_another_tool(path: Path, size: tuple[int, int] | None) -> Source:
    """The lens of another tool's file."""
    # Loaded late: it takes as long as a photo.
    from cubicfish_cli.fitting.conversion.from_lens import ExactLens

    given, found = read_foreign(path, image_size=size)
    exact = ExactLens.of(given)
    text = _camera_text(exact.nearest.camera, {"imported_from": found, "lens": given.name})
    note = {"found": found, "rms_px": exact.nearest.error.rms_px}
    return Source(lens=exact, image_size=given.image_size, text=text, note=note)


def _camera_text(camera: CubicCamera, made_by: Mapping[str, object]) -> str:
    return camera_text(camera, fit={}, made_by={"command": "simulate", **made_by})


@dataclass(frozen=True, kw_only=True)
class SimulatedFiles:
    """What became of :func:`simulate_files`.

    Attributes:
        photos: the photos.
        truth: the files beside them: ``true_corners``, ``true_poses`` and ``true_camera``.
        corners: how many corners can be seen in them.
        image_size: (width, height), pixels.
        seed: their seed.

    """

    photos: Sequence[Path]
    truth: Mapping[str, Path]
    corners: int
    image_size: tuple[int, int]
    seed: int

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish simulate --json`` prints."""
        named = ("photos", "corners", "image_size", "seed")
        return {**{name: getattr(self, name) for name in named}, **self.truth}


def simulate_files(
    target: Target | StrPath,
    lens: Calibrated | CubicCamera | StrPath,
    folder: StrPath = "simulated",
    *,
    image_size: Sequence[int] | None = None,
    poses: StrPath | None = None,
    number: int | None = None,
    form: str | None = None,
    look: LookOptions = _LOOK,
    run: Run = RUN,
) -> SimulatedFiles:
    """Render photos of a target beside their truth, as ``cubicfish simulate`` does.

    The poses fill the camera's field. All files are written, or none.

    Args:
        target: the calibration target, or its file; its boards are rendered flat.
        lens: a camera or a fit; or a file: camera.yaml or another tool's.
        folder: where photo_01.jpg and so on go, true_corners.csv (pixels), true_poses.csv and
            true_camera.yaml.
        image_size: (width, height) of the pictures in pixels, for files that do not say.
        poses: a table to take photos from, such as the true_poses.csv of earlier ones; lengths
            in the target's unit, rotation vectors in radians, ``camera_from_world``.
        number: of photos, without one; by default 12.
        form: of the photos: ``jpg`` or ``png``; by default ``jpg``.
        look: how they look.
        run: how the work is done.

    Raises:
        UsageError: what is asked does not go together.
        CameraFileError: the lens cannot be used.
        CorrespondenceError: the table cannot be used.
        TargetError: the target cannot be drawn, or is not seen so often.
        OutputError: no photo shows a corner, or a file exists and may not be replaced.

    """
    if poses is not None and number is not None:
        raise UsageError("--poses says how many photos there are: leave -n out")
    if number is not None and not 1 <= number <= _MOST_PHOTOS:
        raise UsageError(f"number must be from 1 to {_MOST_PHOTOS}, not {number}")
    form, listener = form or FORMATS[0], run.listener
    if form not in FORMATS:
        told = did_you_mean(str(form), FORMATS)
        raise UsageError(f"photos are not written as {quoted(form)}: {told}")
    thing = target_in(target)
    listener.progress("Choosing where to take photos from")
    source = _source(lens, image_size, thing)
    if source.note is not None:
        listener.tell(Event.NEAREST_CAMERA, **source.note)
    if any(board.shape is not None for board in thing.boards):
        listener.tell(Event.RENDERED_FLAT)
    flat, seed = thing.with_flat_boards(), look.seed
    if poses is None:
        chosen = chosen_poses(thing, source.lens, source.image_size, number or 12, seed=seed)
        digits = max(2, len(str(len(chosen))))
        named = {f"photo_{i:0{digits}d}.{form}": pose for i, pose in enumerate(chosen, start=1)}
    else:
        named = _poses_of_table(Path(poses), form)
    corners = true_corners_text(flat, source.lens, named, source.image_size)
    if corners.count("\n") <= 2:
        raise OutputError("no photo shows a corner: check the poses, the target and its units")
    texts = {
        "true_corners": corners,
        "true_poses": pose_table_text(named),
        "true_camera": source.text,
    }
    width, height = source.image_size
    listener.tell(Event.RENDERING, pictures=plural(len(named), "photo"), width=width, height=height)
    listener.progress(_RENDERING)
    rendered = simulated_photos(flat, source.lens, source.image_size, named, look)

    def write(done: int, path: Path) -> None:
        path.write_bytes(photo_bytes(next(rendered)[1], path.suffix[1:]))
        listener.progress(_RENDERING, done, len(named))

    truth = {name: Path(folder) / f"{name}{_SUFFIXES[name]}" for name in texts}
    photos = {Path(folder) / name: partial(write, done) for done, name in enumerate(named, start=1)}
    files: dict[Path, Content] = {**photos, **{truth[name]: texts[name] for name in texts}}
    write_files(files, overwrite=run.overwrite)
    return SimulatedFiles(
        photos=list(photos),
        truth=truth,
        corners=corners.count("\n") - 2,
        image_size=source.image_size,
        seed=seed,
    )


def _poses_of_table(path: Path, form: str) -> dict[str, Pose]:
    """Poses by the photos' file names."""
    named: dict[str, Pose] = {}
    for name, pose in load_poses(path).items():
        own = Path(name).stem + f".{form}"
        if Path(name).name != name or own in named or own.startswith("."):
            raise CorrespondenceError(
                f"{path}: {quoted(name)} cannot be the name of a photo here: give each row a file "
                "name of its own, without folders"
            )
        named[own] = pose
    return named
