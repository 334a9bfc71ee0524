"""A calibration's record, and each corner's error computed again from it.

Of a fit, or of a calibration's folder, with what cannot be found left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from cubicfish import (
    Calibration,
    CubicCamera,
    CubicfishError,
    FloatArray,
    Observations,
    Target,
    load_camera,
    load_corners,
    quoted,
)
from cubicfish.files import Fingerprint
from cubicfish.judge import CameraFacts, FitRecord, PhotoRecord
from cubicfish.models import angle_from_axis
from cubicfish.photos import find_photos
from cubicfish.solve import Poses
from cubicfish.sufficiency import CoverageGaps
from cubicfish.target.placement import best_named
from cubicfish_cli.inputs.target_source import target_in
from cubicfish_cli.words.camera import photo_words
from cubicfish_cli.words.sufficiency import summary

if TYPE_CHECKING:
    from cubicfish.fit import PointCalibration
    from cubicfish.models import PointCamera

REFINED = ("shape", "points")
"""What ``refine_target`` of a fit's record says where the target was fitted too."""
# Errors that are worked out again and differ by more than this share are of other corners.
_SAME_RMS = 0.02
_SAME_RMS_PX = 1e-3
_REFINED = "target.refined.yaml"
_CORNERS = "corners.csv"
# Programs that save a calibration may put the target there; its place is not on record then.
_TARGET = "target.yaml"

_NO_PHOTOS = (
    "Pictures of the photos, and an undistorted one: the photos are not at hand. "
    "'cubicfish report --photos FOLDER' shows them."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorFacts:
    """Every used corner with its error.

    Attributes:
        pairs: the corners.
        residual: (N, 2) projection less pixel, pixels.
        angle_deg: (N,) from the camera's axis; None for a camera without rays.
        gaps: the field in squares, which of them hold corners, and which parts hold none.

    """

    pairs: Observations
    residual: FloatArray
    angle_deg: FloatArray | None
    gaps: CoverageGaps

    @property
    def length(self) -> FloatArray:
        """(N,) lengths of the residuals, pixels."""
        return np.hypot(self.residual[:, 0], self.residual[:, 1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Facts:
    """What is known of a calibration.

    Attributes:
        known: the camera and its records, and what follows from these.
        verdict_words: how each photo stands beside the others, in words, by its name.
        dropped_pixels: photo and (2,) pixel of those dropped corners that are at hand.
        errors: None where the corners or what they are of are not at hand.
        lack: why ``errors`` is None; None where it is not.
        target: the calibration target as fitted; None where it is not at hand.
        files: where each photo is, as far as that is known.
        digests: SHA-256 that a photo's file must have to be shown, where that is known.
        absent: what the page lacks and why, a line each.
        sources: the files that it was read from, beside the camera's.
        advice: what to photograph next, in a line; None where the corners are not at hand or the
            camera has no rays.

    """

    known: CameraFacts
    verdict_words: Mapping[str, str]
    dropped_pixels: tuple[tuple[str, FloatArray], ...]
    errors: ErrorFacts | None
    lack: str | None
    target: Target | None
    files: Mapping[str, Path]
    digests: Mapping[str, str]
    absent: tuple[str, ...]
    sources: tuple[Path, ...]
    advice: str | None

    @property
    def camera(self) -> CubicCamera | PointCamera:
        """The camera."""
        return self.known.camera

    @property
    def fit(self) -> FitRecord:
        """How well it fits."""
        return self.known.fit

    @property
    def photos(self) -> tuple[PhotoRecord, ...]:
        """Of the fit, in its order."""
        return self.fit.per_image

    @property
    def units(self) -> str:
        """Unit of lengths; empty where the target is not known."""
        return self.target.units if self.target else ""

    @cached_property
    def outline(self) -> FloatArray:
        """(K, 2) the field within the photo where the camera may be trusted, pixels."""
        # As camera.yaml has it, so that a camera from memory gives the same page as from its file.
        return np.round(self.camera.outline(), 3)


def gather(
    known: CameraFacts,
    *,
    pairs: Observations | None,
    target: Target | None,
    files: Mapping[str, Path],
    digests: Mapping[str, str] | None = None,
    lack: str | None = None,
    sources: Sequence[Path] = (),
) -> Facts:
    """Put together what is known.

    Args:
        known: the camera and its records.
        pairs: the corners with the world points of the target as fitted. Those that the fit
            left out may be among them.
        target: the calibration target as fitted.
        files: the photos' files by the photos' names.
        digests: SHA-256 that these files must have, by the photos' names; others are not shown.
        lack: why there are no pairs.
        sources: the files that all this was read from, beside the camera's.

    """
    camera, fit = known.camera, known.fit
    verdict_words = zip(fit.per_image, known.photo_verdicts, strict=True)
    errors = None
    pixels: tuple[tuple[str, FloatArray], ...] = ()
    if pairs is not None:
        if target is not None and fit.renamed_images:
            pairs = best_named(
                pairs,
                target,
                lambda one: np.square(_measure_residuals(camera, fit, one)[1]).sum(axis=1),
            )
        errors, lack = _measure_errors(camera, fit, pairs)
        pixels = tuple(
            (pairs.images[pairs.image[index]], pairs.pixel[index])
            for index in np.flatnonzero(_find_dropped(pairs, fit))
        )
    return Facts(
        known=known,
        verdict_words={photo.image: photo_words(own.reasons) for photo, own in verdict_words},
        dropped_pixels=pixels,
        errors=errors,
        lack=lack,
        target=target,
        files=files,
        digests=digests or {},
        absent=tuple(_list_absent(lack, [photo.image for photo in fit.per_image], files)),
        sources=tuple(sources),
        advice=None if errors is None else summary(known, errors.pairs),
    )


def _list_absent(
    lack: str | None, names: Sequence[str], files: Mapping[str, Path]
) -> Iterator[str]:
    """Yield what a page about a calibration does without, and why, a line each."""
    if lack is not None:
        hint = "'cubicfish report --target FILE' names another target"
        yield f"Corners and errors: {lack}; {hint}."
    lost = [name for name in names if name not in files]
    if lost and not files:
        yield _NO_PHOTOS
    elif lost:
        yield f"{len(lost)} of {len(names)} photos are not at hand, such as {lost[0]}."


def _measure_residuals(
    camera: CubicCamera | PointCamera, fit: FitRecord, pairs: Observations
) -> tuple[FloatArray, FloatArray]:
    """(N, 3) corners in the camera's frame, and (N, 2) projection less pixel.

    NaN in photos whose place is not on record.
    """
    points, poses = np.full(pairs.world.shape, np.nan), fit.poses
    if not isinstance(camera, CubicCamera) and camera.frame == "world":
        poses = {photo.image: (np.zeros(3), np.zeros(3)) for photo in fit.per_image}
    for photo, name in enumerate(pairs.images):
        known = Poses.of_photos(poses, [name])
        if known is not None:
            own = pairs.image == photo
            points[own] = known.apply(np.zeros(int(own.sum()), np.intp), pairs.world[own])
    if isinstance(camera, CubicCamera):
        camera = camera.over_corners(fit.covered_deg)
    return points, camera.project(points, near=True) - pairs.pixel


def _measure_errors(
    camera: CubicCamera | PointCamera, fit: FitRecord, pairs: Observations
) -> tuple[ErrorFacts | None, str | None]:
    """Every used corner's error, or why there is none."""
    points, residual = _measure_residuals(camera, fit, pairs)
    length = np.hypot(*residual.T)
    kept = np.isfinite(length) & ~_find_dropped(pairs, fit)
    if fit.refine_target == "points":
        # A corner that may be another one than it is named as had a point of its own in the fit.
        kept &= pairs.certain
    if not isinstance(camera, CubicCamera) and 0 < fit.corners < kept.sum():
        # Which corners this fit dropped is not on record: they were the worst.
        order = np.argsort(np.where(kept, length, np.inf), kind="stable")
        kept[order[fit.corners :]] = False
    if not kept.any():
        return None, "no corner at hand is of a photo of this fit, where the camera may be trusted"
    used, _ = pairs.select(kept).only_seen()
    residual, points = residual[kept], points[kept]
    before, now = fit.rms_px, float(np.sqrt((residual**2).sum(axis=1).mean()))
    if abs(now - before) > max(_SAME_RMS * before, _SAME_RMS_PX):
        return None, (
            f"the corners and the target at hand give an RMS of {now:.3f} px and the fit had "
            f"{before:.3f} px: they are not those of the fit"
            + (
                " (the target was fitted too, and target.refined.yaml holds it)"
                if fit.refine_target in REFINED
                else ""
            )
        )
    is_ray = isinstance(camera, CubicCamera)
    angle = np.rad2deg(angle_from_axis(points)) if is_ray else None
    gaps = CoverageGaps.of(camera, used)
    return ErrorFacts(pairs=used, residual=residual, angle_deg=angle, gaps=gaps), None


def _find_dropped(pairs: Observations, fit: FitRecord) -> npt.NDArray[np.bool_]:
    """Which pairs are corners that the fit dropped."""
    if not fit.dropped_corners:
        return np.zeros(len(pairs.pixel), bool)
    gone = {(one.image, one.board, one.column, one.row) for one in fit.dropped_corners}
    rows = np.stack([pairs.image, pairs.board, pairs.column, pairs.row], axis=1).tolist()
    names = [*pairs.boards, None]  # of points without a board, whose index is -1
    return np.array([(pairs.images[i], names[b], c, r) in gone for i, b, c, r in rows], bool)


def matched(names: Sequence[str], paths: Sequence[Path]) -> dict[str, Path]:
    """Which file is which photo: by the file's name, or the end of its path.

    A name that several files have is left out, as is one that none has.
    """
    found: dict[str, list[Path]] = {}
    for path in paths:
        parts = path.as_posix().split("/")
        for length in range(1, len(parts) + 1):
            found.setdefault("/".join(parts[-length:]), []).append(path)
    return {name: found[name][0] for name in names if len(found.get(name, ())) == 1}


def facts_of_files(
    camera_file: Path,
    *,
    target: Path | None,
    photos: Sequence[Path],
    corners: Path | None = None,
) -> Facts:
    """Read a camera and what lies beside it, or where it says that it came from.

    A file that the camera file names is read only if it still has the SHA-256 that stands there.

    Args:
        camera_file: camera.yaml; corners.csv, target.refined.yaml and, where the target's place is
            not on record, target.yaml are looked for beside it.
        target: the nominal calibration target, where it is not at its recorded place.
        photos: files, folders or patterns of the photos, where they are not at theirs.
        corners: the corners.csv of the fit, where it is not beside the camera.

    Raises:
        CubicfishError: a file that is there cannot be used.

    """
    loaded = load_camera(camera_file, any_lift=True)
    origin, folder = loaded.origin, camera_file.parent
    nominal = _find_target(target, folder, loaded)
    thing = None if nominal is None else target_in(nominal)
    beside = corners or folder / _CORNERS
    table = _find_table(beside, folder, loaded, thing)
    if table is None:
        pairs, lack = None, _explain_lack(folder, loaded, thing)
    else:
        is_named = table == beside or origin.target is not None
        size = loaded.camera.image_size
        pairs, lack = load_corners(table, thing if is_named else None, image_size=size), None
    names = [photo.image for photo in loaded.fit.per_image]
    digests = {one.path: one.sha256 for one in origin.inputs}
    recorded = matched(names, [*digests])
    files = _find_photos(photos, names) if photos else _find_all(recorded, folder)
    return gather(
        loaded,
        pairs=pairs,
        target=thing,
        files=files,
        digests={name: digests[path] for name, path in recorded.items()},
        lack=lack,
        sources=[path for path in (nominal, table, *files.values()) if path is not None],
    )


def _find_target(given: Path | None, folder: Path, loaded: CameraFacts) -> Path | None:
    """The target as fitted: beside the camera where it was fitted too, else the nominal one."""
    if loaded.fit.refine_target in REFINED:
        return _find_beside(folder, _REFINED) or given
    return given or _find_recorded(loaded.origin.target, folder) or _find_beside(folder, _TARGET)


def _find_photos(given: Sequence[Path], names: Sequence[str]) -> dict[str, Path]:
    """The photos that a caller names, by their own names and by those of a fit."""
    found = find_photos(given)
    own = {photo.name: photo.path for photo in found}
    return {**matched(names, [*own.values()]), **own}


def _find_all(recorded: Mapping[str, Path], folder: Path) -> dict[str, Path]:
    """Those of recorded files that are there, by name."""
    places = {name: _place(path, folder) for name, path in recorded.items()}
    return {name: path for name, path in places.items() if path is not None}


def facts_of_fit(
    fitted: Calibration | PointCalibration, pairs: Observations, photos: Sequence[Path]
) -> Facts:
    """What a page says of a fit that is still at hand.

    Args:
        fitted: the fit.
        pairs: what was fitted to.
        photos: the photos' files; none for corners alone.

    """
    target = fitted.target
    if target is not None:
        pairs = pairs.with_target(target)
    files = matched([photo.image for photo in fitted.fit.per_image], photos)
    return gather(fitted, pairs=pairs, target=target, files=files)


def _find_table(
    beside: Path, folder: Path, loaded: CameraFacts, target: Target | None
) -> Path | None:
    """The table of corners or points: beside the camera, else the one that it came from."""
    origin = loaded.origin
    if target is not None and beside.is_file():
        return beside
    table = _find_recorded(origin.inputs[0], folder) if len(origin.inputs) == 1 else None
    is_csv = table is not None and table.suffix.lower() == ".csv"
    return table if is_csv and (origin.target is None or target is not None) else None


def _explain_lack(folder: Path, loaded: CameraFacts, target: Target | None) -> str:
    """What is missing of the corners, or of what they are of."""
    origin, has_corners = loaded.origin, (folder / _CORNERS).is_file()
    if target is None and (has_corners or (origin.inputs and origin.target is not None)):
        if loaded.fit.refine_target in REFINED:
            return f"the target was fitted too, and {_REFINED} is not beside the camera"
        if origin.target is not None:
            name = quoted(origin.target.file)
            return f"the target is not where it was, or has changed ({name})"
        return f"the target is not on record, and no {_TARGET} is beside the camera"
    if origin.inputs:
        source = "the table that it was calibrated from is not where it was, or has changed"
    else:
        source = "what it was calibrated from is not on record"
    return f"there is no {_CORNERS} beside the camera, and {source}"


def _find_beside(folder: Path, name: str) -> Path | None:
    path = folder / name
    return path if path.is_file() else None


def _find_recorded(record: Fingerprint | None, folder: Path) -> Path | None:
    """The file that a record names, if it is there and still the same."""
    if record is None:
        return None
    path = _place(Path(record.file), folder)
    try:
        return path if path and Fingerprint.of(path).sha256 == record.sha256 else None
    except CubicfishError:
        return None


def _place(path: Path, folder: Path) -> Path | None:
    """Where a recorded path leads: from here, or from the folder that holds the calibration's."""
    for place in (path, Path(realpath(folder)).parent / path):
        try:
            if place.is_file():
                return place
        except (OSError, ValueError):  # a name that no file can have
            continue
    return None
