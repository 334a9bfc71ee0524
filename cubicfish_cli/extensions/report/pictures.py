"""Small copies of the photos for the page, with the corners found in them."""

import hashlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import (
    CubicCamera,
    FloatArray,
    PhotoError,
    ViewError,
    build_map,
    build_view,
    undistort,
)
from cubicfish.photos import PictureFile
from cubicfish_cli.inputs.calibration_facts import Facts, PhotoRecord
from cubicfish_cli.render.small_pictures import data_uri, thumbnail

Small = npt.NDArray[np.uint8]
# So many a page can carry and a reader look at: more photos have a row in the table only.
MOST_THUMBNAILS = 48
MOST_CARDS = 12
# Reading photos is what takes time: a fifth of a second for each 12 million pixels.
_MOST_PIXELS = 150_000_000
_THUMBNAIL, _CARD, _WIDE = 144, 640, 720
# The photo that a reader may look around in, and its quality.
_LIVE, _LIVE_QUALITY = 1280, 80
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
        example: None if no photo can be read or the camera has no rays.
        problems: why photos are missing, a line each.

    """

    photos: Mapping[str, PhotoPicture]
    example: Example | None
    problems: tuple[str, ...]


def all_pictures(facts: Facts, zoom: float) -> Pictures:
    """Read photos, those with the largest errors first, and make their copies.

    Args:
        facts: the calibration; photos are those of its ``files``.
        zoom: the magnification of the drawn errors.

    """
    order = sorted(
        (photo for photo in facts.photos if photo.image in facts.files),
        key=lambda photo: -np.nan_to_num(photo.rms_px),
    )
    width, height = facts.camera.image_size
    most = max(1, min(MOST_THUMBNAILS, _MOST_PIXELS // (width * height)))
    chosen = order[:most]
    example = max(chosen, key=lambda photo: photo.corners, default=None)

    def made(photo: PhotoRecord) -> tuple[PhotoPicture, Example | None] | str:
        large, card = photo in chosen[:MOST_CARDS], None
        least = _CARD if large else _THUMBNAIL
        try:
            picture = _read(facts, photo, None if photo is example else least)
        except PhotoError as problem:
            return f"{problem}."
        copy = thumbnail(picture, least)
        if large:
            card = data_uri(_draw_found(facts, photo, copy, zoom), _QUALITY)
        copies = PhotoPicture(small=data_uri(thumbnail(copy, _THUMBNAIL), _QUALITY), card=card)
        return copies, _make_example(facts, photo, picture) if photo is example else None

    with ThreadPoolExecutor(_THREADS) as threads:
        done = list(zip(chosen, threads.map(made, chosen), strict=True))
    problems = _some_of([one for _, one in done if isinstance(one, str)])
    read = [(photo, one) for photo, one in done if not isinstance(one, str)]
    return Pictures(
        photos={photo.image: copies for photo, (copies, _) in read},
        example=next((shown for _, (_, shown) in read if shown is not None), None),
        problems=problems,
    )


def _some_of(problems: Sequence[str]) -> tuple[str, ...]:
    """The first of the photos' problems, and how many more there are."""
    if len(problems) <= _MOST_PROBLEMS:
        return (*problems,)
    more = f"So are {len(problems) - _MOST_PROBLEMS} more photos."
    return (*problems[:_MOST_PROBLEMS], more)


def _read(facts: Facts, photo: PhotoRecord, least: int | None) -> npt.NDArray[Any]:
    """Read a photo of a fit, its longer side at least so many pixels, or in the camera's size.

    Raises:
        PhotoError: it cannot be read, or has changed since the fit.

    """
    path, digest = facts.files[photo.image], facts.digests.get(photo.image)
    file = PictureFile.read(path)
    if digest is not None and hashlib.sha256(file.data).hexdigest() != digest:
        raise PhotoError(f"{path} is not shown: it is no longer the photo that was calibrated with")
    picture, size = file.picture(least=least), facts.camera.image_size
    if not file.is_copy_of(size):
        raise PhotoError(f"{path} is not shown: it is not of the camera's size")
    whole = least is None and file.size != size
    return cv2.resize(picture, size) if whole else picture


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


def _make_example(facts: Facts, photo: PhotoRecord, picture: npt.NDArray[Any]) -> Example | None:
    if not isinstance(facts.camera, CubicCamera):
        return None
    try:
        view = build_view(facts.camera)
        scale = min(1.0, 2 * _WIDE / max(view.size))
        size = (max(1, round(scale * view.size[0])), max(1, round(scale * view.size[1])))
        view = replace(view, size=size, focal=scale * view.focal)
        after = undistort(picture, build_map(facts.camera, view))
    except ViewError:
        return None
    return Example(
        name=photo.image,
        before=data_uri(thumbnail(picture, _LIVE), _LIVE_QUALITY),
        after=data_uri(thumbnail(after, _WIDE), _QUALITY),
        view=f"{view.kind}, {view.hfov_deg:.0f}° wide",
    )
