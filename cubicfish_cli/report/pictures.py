"""Small copies of the photos for the page, with what was found in them."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import PhotoError, ViewError
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.photos import Picture, decode_picture, read_file
from cubicfish_cli.rendering.difference_picture import jpeg_bytes, thumbnail
from cubicfish_cli.report.facts import Facts, PhotoFacts
from cubicfish_cli.types import FloatArray
from cubicfish_cli.undistortion.images import remap_picture
from cubicfish_cli.undistortion.maps import build_map
from cubicfish_cli.undistortion.views import default_view

# What a page can carry and a reader look at: more photos have a row in the table only.
MOST_THUMBNAILS = 48
MOST_CARDS = 12
# Reading photos is what takes time: a fifth of a second for each 12 million pixels.
_MOST_PIXELS = 150_000_000
_THUMBNAIL, _CARD, _WIDE = 144, 640, 720
_QUALITY = 72
_THREADS = 2
_MOST_PROBLEMS = 5


@dataclass(frozen=True, kw_only=True)
class Overlay:
    """What is drawn over a photo, as paths in its pixels.

    Attributes:
        found: a dot for each detected corner.
        expected: a cross where the camera puts it.
        errors: the way between, magnified.
        dropped: a saltire for each corner that was left out.

    """

    found: str
    expected: str
    errors: str
    dropped: str


@dataclass(frozen=True, kw_only=True)
class PhotoPicture:
    """A photo's small copies, as data URIs of JPEG files; ``card`` is None for most of many."""

    small: str
    card: str | None
    overlay: Overlay | None


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
        (photo for photo in facts.photos if photo.name in facts.files),
        key=lambda photo: -(photo.rms_px or 0.0),
    )
    width, height = facts.camera.image_size
    most = max(1, min(MOST_THUMBNAILS, _MOST_PIXELS // (width * height)))
    chosen = order[:most]
    example = max(chosen, key=lambda photo: photo.corners, default=None)

    def made(photo: PhotoFacts) -> tuple[PhotoPicture | None, Example | None, str | None]:
        picture = _read(facts.files[photo.name], (width, height), facts.digests.get(photo.name))
        if isinstance(picture, str):
            return None, None, picture
        copies = _copies(facts, photo, picture, zoom, card=photo in chosen[:MOST_CARDS])
        return copies, _example(facts, photo, picture) if photo is example else None, None

    with ThreadPoolExecutor(_THREADS) as threads:
        done = list(threads.map(made, chosen))
    return Pictures(
        photos={
            photo.name: copies
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
    facts: Facts, photo: PhotoFacts, picture: Picture, zoom: float, *, card: bool
) -> PhotoPicture:
    middle = thumbnail(picture, _CARD)
    return PhotoPicture(
        small=_uri(thumbnail(middle, _THUMBNAIL)),
        card=_uri(middle) if card else None,
        overlay=_overlay(facts, photo, zoom) if card else None,
    )


def _uri(picture: npt.NDArray[np.uint8]) -> str:
    return "data:image/jpeg;base64," + base64.b64encode(jpeg_bytes(picture, _QUALITY)).decode()


def _example(facts: Facts, photo: PhotoFacts, picture: Picture) -> Example | None:
    if not isinstance(facts.camera, CubicCamera):
        return None
    try:
        view = default_view(facts.camera)
        scale = min(1.0, 2 * _WIDE / max(view.size))
        size = (max(1, round(scale * view.size[0])), max(1, round(scale * view.size[1])))
        view = replace(view, size=size, focal=scale * view.focal)
        after = remap_picture(picture, build_map(facts.camera, view))
    except ViewError:
        return None
    return Example(
        name=photo.name,
        before=_uri(thumbnail(picture, _WIDE)),
        after=_uri(thumbnail(after, _WIDE)),
        view=f"{view.kind}, {view.hfov_deg:.0f}° wide",
    )


def _overlay(facts: Facts, photo: PhotoFacts, zoom: float) -> Overlay | None:
    errors = facts.errors
    if errors is None or photo.name not in errors.pairs.images:
        return None
    own = errors.pairs.image == errors.pairs.images.index(photo.name)
    found, residual = errors.pairs.pixel[own], errors.residual[own]
    arm = max(facts.camera.image_size) / 160
    expected = found + residual
    across, down = np.array([arm, 0.0]), np.array([0.0, arm])
    return Overlay(
        found=_lines(np.stack([found, found], axis=1)),
        expected=_lines(np.stack([expected - across, expected + across], axis=1))
        + _lines(np.stack([expected - down, expected + down], axis=1)),
        errors=_lines(np.stack([found, found + zoom * residual], axis=1)),
        dropped=_dropped(facts, photo, arm),
    )


def _dropped(facts: Facts, photo: PhotoFacts, arm: float) -> str:
    """Marks at the dropped corners of a photo, where their pixels are known."""
    pixel = np.array([place for name, place in facts.dropped_pixels if name == photo.name])
    if not len(pixel):
        return ""
    return "".join(
        _lines(np.stack([pixel - way, pixel + way], axis=1))
        for way in (np.array([arm, arm]), np.array([arm, -arm]))
    )


def _lines(ends: FloatArray) -> str:
    """(N, 2, 2) as the ``d`` of a path, to a tenth of a pixel."""
    return "".join(f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" for (x0, y0), (x1, y1) in ends.tolist())
