"""A calibration's folder -> what a page says of it, with what cannot be found left out.

Small copies of the photos for the page, with what was found in them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.photos import (
    Picture,
    data_uri,
    decode_picture,
    find_photos,
    read_file,
    thumbnail,
)
from cubicfish_cli.app.undistortion.images import remap_picture
from cubicfish_cli.core.assess.fit_record import FileRecord, Origin, origin_of
from cubicfish_cli.core.errors import PhotoError, ViewError
from cubicfish_cli.core.files import sha256_of
from cubicfish_cli.core.fit.calibration import Calibration
from cubicfish_cli.core.io.camera_yaml import load_any_camera
from cubicfish_cli.core.io.observations_csv import load_corners, load_correspondences
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target, load_target
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.views.choose import build_view
from cubicfish_cli.core.views.maps import build_map
from cubicfish_cli.core.wording import quoted
from cubicfish_cli.extensions.report.facts import REFINED, Facts, Lack, PhotoRecord, gather

if TYPE_CHECKING:
    from cubicfish_cli.core.fit.point_fit import PointCalibration

Small = npt.NDArray[np.uint8]
# What a page can carry and a reader look at: more photos have a row in the table only.
MOST_THUMBNAILS = 48
MOST_CARDS = 12
# Reading photos is what takes time: a fifth of a second for each 12 million pixels.
_MOST_PIXELS = 150_000_000
_THUMBNAIL, _CARD, _WIDE = 144, 640, 720
# Colours of what is drawn over photos, as report.html has them, BGR.
_FOUND, _ERROR, _DROPPED = (233, 180, 86), (0, 160, 240), (54, 90, 255)
_QUALITY = 72
_THREADS = 2
_MOST_PROBLEMS = 5


@dataclass(frozen=True, kw_only=True)
class PhotoPicture:
    """A photo's small copies, as data URIs of JPEG files; ``card`` is None for most of many."""

    small: str
    card: str | None


@dataclass(frozen=True, kw_only=True)
class Example:
    """A photo and its undistorted view, as data URIs, and what the view is."""

    name: str
    before: str
    after: str
    view: str


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """All pictures of a page.

    Attributes:
        photos: by the photo's name, those with the largest errors first.
        example: None where no photo is at hand or the camera has no rays.
        problems: why photos are missing, a line each.

    """

    photos: Mapping[str, PhotoPicture]
    example: Example | None
    problems: tuple[str, ...]


def all_pictures(facts: Facts, zoom: float) -> Pictures:
    """Read photos, those with the largest errors first, and make their copies.

    Args:
        facts: the calibration; photos are those of its ``files``.
        zoom: how many times as long as they are errors are drawn.

    """
    order = sorted(
        (photo for photo in facts.photos if photo.image in facts.files),
        key=lambda photo: -np.nan_to_num(photo.rms_px),
    )
    width, height = facts.camera.image_size
    most = max(1, min(MOST_THUMBNAILS, _MOST_PIXELS // (width * height)))
    chosen = order[:most]
    example = max(chosen, key=lambda photo: photo.corners, default=None)

    def made(photo: PhotoRecord) -> tuple[PhotoPicture | None, Example | None, str | None]:
        picture = _read(facts.files[photo.image], (width, height), facts.digests.get(photo.image))
        if isinstance(picture, str):
            return None, None, picture
        copies = _copies(facts, photo, picture, zoom, card=photo in chosen[:MOST_CARDS])
        return copies, _example(facts, photo, picture) if photo is example else None, None

    with ThreadPoolExecutor(_THREADS) as threads:
        done = list(threads.map(made, chosen))
    return Pictures(
        photos={
            photo.image: copies
            for photo, (copies, _, _) in zip(chosen, done, strict=True)
            if copies is not None
        },
        example=next((shown for _, shown, _ in done if shown is not None), None),
        problems=_few([problem for _, _, problem in done if problem is not None]),
    )


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


def _read(path: Path, size: tuple[int, int], digest: str | None) -> Picture | str:
    """A photo, or why there is none."""
    try:
        data = read_file(path)
        if digest is not None and hashlib.sha256(data).hexdigest() != digest:
            return f"{path} is not shown: it is no longer the photo that was calibrated with."
        picture = decode_picture(path, data)
    except PhotoError as problem:
        return f"{problem}."
    if picture.shape[1::-1] != size:
        return f"{path} is not shown: it is not of the camera's size."
    return picture


def _few(problems: Sequence[str]) -> tuple[str, ...]:
    more = len(problems) - _MOST_PROBLEMS
    rest = (f"So are {more} more photos.",) if more > 0 else ()
    return (*problems[:_MOST_PROBLEMS], *rest)


def _copies(
    facts: Facts, photo: PhotoRecord, picture: Picture, zoom: float, *, card: bool
) -> PhotoPicture:
    middle = thumbnail(picture, _CARD)
    return PhotoPicture(
        small=data_uri(thumbnail(middle, _THUMBNAIL), _QUALITY),
        card=data_uri(_draw_found(facts, photo, middle, zoom), _QUALITY) if card else None,
    )


def _draw_found(facts: Facts, photo: PhotoRecord, copy: Small, zoom: float) -> Small:
    """Draw a photo's corners, their errors and the dropped ones on a small copy of it."""
    drawn = np.dstack([copy] * 3) if copy.ndim == 2 else copy.copy()
    scale = drawn.shape[1] / facts.camera.image_size[0]

    def placed(pixel: FloatArray) -> list[tuple[int, int]]:
        clipped = np.clip((pixel + 0.5) * scale - 0.5, -1e4, 1e4)
        return [(x, y) for x, y in np.rint(clipped).astype(int).tolist()]

    if facts.errors is not None and photo.image in facts.errors.pairs.images:
        pairs = facts.errors.pairs
        own = pairs.image == pairs.images.index(photo.image)
        found = pairs.pixel[own]
        ends = placed(found + zoom * facts.errors.residual[own])
        for start, end in zip(placed(found), ends, strict=True):
            cv2.circle(drawn, start, 3, _FOUND, -1, cv2.LINE_AA)
            cv2.line(drawn, start, end, _ERROR, 2, cv2.LINE_AA)
    for name, pixel in facts.dropped_pixels:
        if name == photo.image:
            (place,) = placed(pixel[None])
            cv2.drawMarker(drawn, place, _DROPPED, cv2.MARKER_TILTED_CROSS, 10, 2)
    return drawn


def _example(facts: Facts, photo: PhotoRecord, picture: Picture) -> Example | None:
    if not isinstance(facts.camera, CubicCamera):
        return None
    try:
        view = build_view(facts.camera)
        scale = min(1.0, 2 * _WIDE / max(view.size))
        size = (max(1, round(scale * view.size[0])), max(1, round(scale * view.size[1])))
        view = replace(view, size=size, focal=scale * view.focal)
        after = remap_picture(picture, build_map(facts.camera, view))
    except ViewError:
        return None
    return Example(
        name=photo.image,
        before=data_uri(thumbnail(picture, _WIDE), _QUALITY),
        after=data_uri(thumbnail(after, _WIDE), _QUALITY),
        view=f"{view.kind}, {view.hfov_deg:.0f}° wide",
    )


_REFINED = "target.refined.yaml"
_CORNERS = "corners.csv"
# Programs that save a calibration may put the target there; its place is not on record then.
_TARGET = "target.yaml"


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
        target: the calibration target as drawn, where it is not at its recorded place.
        photos: files, folders or patterns of the photos, where they are not at theirs.
        corners: the corners.csv of the fit, where it is not beside the camera.

    Raises:
        CubicfishError: a file that is there cannot be used.

    """
    loaded = load_any_camera(camera_file)
    origin = origin_of(loaded.made_by)
    folder = camera_file.parent
    absent: list[str] = []
    refined = loaded.fit.refine_target in REFINED
    drawn = target or _recorded(origin.target, folder) or _beside(folder, _TARGET)
    if refined:
        drawn = _beside(folder, _REFINED) or target
    thing = None if drawn is None else load_target(drawn)
    size = loaded.camera.image_size
    pairs = _pairs(corners or folder / _CORNERS, folder, origin, thing, size)
    lack = _lack(folder, origin, thing, refined=refined) if pairs is None else None
    names = [photo.image for photo in loaded.fit.per_image]
    digests = {Path(one.file): one.sha256 for one in origin.inputs}
    recorded = matched(names, [*digests])
    if photos:
        found = find_photos(photos)
        files = {photo.name: photo.path for photo in found}
        files = {**matched(names, [photo.path for photo in found]), **files}
    else:
        places = {name: _place(path, folder) for name, path in recorded.items()}
        files = {name: path for name, path in places.items() if path is not None}
    lost = [name for name in names if name not in files]
    if lost and files:
        absent.append(f"{len(lost)} of {len(names)} photos are not at hand, such as {lost[0]}.")
    return gather(
        loaded,
        pairs=pairs,
        target=thing,
        files=files,
        digests={name: digests[path] for name, path in recorded.items()},
        lack=lack,
        absent=absent,
    )


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


def _pairs(
    beside: Path,
    folder: Path,
    origin: Origin,
    target: Target | None,
    size: tuple[int, int],
) -> Observations | None:
    if target is not None and beside.is_file():
        return load_corners(beside, target, image_size=size).by_photo()
    table = _recorded(origin.inputs[0], folder) if len(origin.inputs) == 1 else None
    if table is None or table.suffix.lower() != ".csv":
        return None
    if origin.target is None:
        return load_correspondences(table, image_size=size)
    return None if target is None else load_corners(table, target, image_size=size).by_photo()


def _lack(folder: Path, origin: Origin, target: Target | None, *, refined: bool) -> Lack:
    """What is missing of the corners, or of what they are of."""
    has_corners = (folder / _CORNERS).is_file()
    has_table = has_corners or origin.inputs
    if target is None and has_table and (origin.target is not None or has_corners):
        if refined:
            why = f"the target was fitted too, and {_REFINED} is not beside the camera"
        elif origin.target is not None:
            name = quoted(origin.target.file)
            why = f"the target is not where it was, or has changed ({name})"
        else:
            why = f"the target is not on record, and no {_TARGET} is beside the camera"
        return Lack(why=why, name_it="--target")
    why = f"there is no {_CORNERS} beside the camera, and "
    if origin.inputs:
        why += "the table that it was calibrated from is not where it was, or has changed"
    else:
        why += "what it was calibrated from is not on record"
    return Lack(why=why, name_it="--corners")


def _beside(folder: Path, name: str) -> Path | None:
    path = folder / name
    return path if path.is_file() else None


def _recorded(record: FileRecord | None, folder: Path) -> Path | None:
    """The file that a record names, if it is there and still the same."""
    if record is None:
        return None
    path = _place(Path(record.file), folder)
    try:
        return path if path and sha256_of(path) == record.sha256 else None
    except OSError:
        return None


def _place(path: Path, folder: Path) -> Path | None:
    """Where a recorded path leads: from here, or from the folder that holds the calibration's."""
    for place in (path, folder.resolve().parent / path):
        try:
            if place.is_file():
                return place
        except (OSError, ValueError):  # a name that no file can have
            continue
    return None
