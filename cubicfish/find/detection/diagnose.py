"""Why a photo shows no grid."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.accept import USUAL_BLUR, is_regular
from cubicfish.find.detection.corners import find_corners
from cubicfish.find.detection.dots import count_dots, find_opposite_pairs
from cubicfish.find.detection.grids import Float32Array, FoundGrids
from cubicfish.find.detection.growth import clean
from cubicfish.find.detection.ladder import MOST_PIXELS
from cubicfish.find.detection.links import find_patches
from cubicfish.find.detection.pyramid import (
    SMALLEST_SIDE,
    Pyramid,
    build_pyramid,
    enlarged,
    estimate_noise,
    reduced,
)
from cubicfish.find.detection.refine import refine_pixels
from cubicfish.judge.codes import Code
from cubicfish.judge.finding import Finding
from cubicfish.types import FloatArray

# Of the range of the photo's number type: brightest and darkest that 99 % of the pixels keep to.
_DARK, _BRIGHT = 0.08, 0.97
_FLAT = 8  # times the noise: less between dark and bright is no pattern
# Squares of a grid must be at least this large to be found.
_SMALLEST_SQUARE = 6
# From half of a photo's size to an eighth the steepest slopes grow fourfold, pixel for pixel, where
# an edge is far wider than a pixel, and stay alike where it is sharp; the middle means 3 px.
_SLOPE_GROWTH = 2.0
# Directions in which slopes are looked at. Where no edge lies across one, only shades are left of
# it, which are soft in a sharp photo too: slopes below this share of the steepest.
_DIRECTIONS, _LEAST_EDGE = 12, 0.25
# Dark squares that no longer touch: how many, how full of their own rectangle, how long at most.
_LEAST_SPOTS, _FULL, _LONG, _LEAST_AREA = 8, 0.7, 2.5, 9
# A photo is looked at reduced to so many pixels, and half as large, before finer scales.
_COARSE_PIXELS = 500_000
# A piece of so many corners is likely a board's: fewer may be anything. Where its squares are this
# large, nothing of a board is too small to be seen.
_SURE, _LARGE_PX = 12, 12.0
# Pieces that are looked at at each scale, those of most corners first.
_PIECES = 3
# Names of the scales, each half of the one before it.
_SCALES = ("full", "half", "quarter", "eighth", "sixteenth", "less")


@dataclass(frozen=True, kw_only=True)
class _Squares:
    """A piece of a grid that was not accepted as a board's.

    Attributes:
        corners: how many it has.
        columns, rows: how far they reach, the more first.
        low, high: (2,) x, y of the box around it, pixels of the photo.
        side_px, blur_px: of its squares, pixels of the photo.
        zoom: how many times smaller the photo was in which it was seen.

    """

    corners: int
    columns: int
    rows: int
    low: FloatArray
    high: FloatArray
    side_px: float
    blur_px: float
    zoom: int

    @property
    def is_likely_a_board(self) -> bool:
        """Whether there is more of it than chance and texture make."""
        return self.corners >= _SURE

    @property
    def area(self) -> float:
        """About how much of the photo it fills, pixels."""
        return self.corners * self.side_px**2

    @property
    def figures(self) -> dict[str, int | float | str]:
        """What sentences say of it."""
        return {
            "columns": self.columns,
            "rows": self.rows,
            "side_px": self.side_px,
            "blur_px": self.blur_px,
            "seen_at": _SCALES[min(int(np.log2(self.zoom)), len(_SCALES) - 1)],
        }


def explain_no_grids(image: npt.NDArray[np.generic], found: FoundGrids) -> Finding:
    """What is wrong with a photo in which no grid was found.

    Args:
        image: (H, W) grey levels.
        found: what :func:`~.finder.find_grids` found in it.

    """
    height, width = image.shape
    if min(height, width) < SMALLEST_SIDE:
        return Finding(code=Code.PHOTO_TOO_SMALL, figures={"width": width, "height": height})
    zoom = _find_zoom(image, MOST_PIXELS)
    small = np.asarray(reduced(image, zoom))
    sample = small[:: max(1, height // 500), :: max(1, width // 500)]
    low, high = np.percentile(sample, [1, 99])
    # Floats have no largest: nothing in them is too dark, too bright or burnt.
    full = np.iinfo(small.dtype).max if np.issubdtype(small.dtype, np.integer) else np.nan
    if high < _DARK * full:
        return Finding(code=Code.TOO_DARK)
    too_bright = low > _BRIGHT * full
    if high <= low and not too_bright:
        return Finding(code=Code.NO_PATTERN)
    dots = count_dots(build_pyramid(reduced(image, _find_zoom(image, _COARSE_PIXELS))))
    pyramid = build_pyramid(small)
    if not too_bright and not dots and _is_noise(pyramid, high - low):
        return Finding(code=Code.LOW_CONTRAST)
    if _are_dark_squares_apart(small >= _BRIGHT * full):
        return Finding(code=Code.TOO_BRIGHT, case="burnt")
    if dots:
        return Finding(code=Code.DOTS, figures={"dots": dots})
    seen = _look_at_scales(image, zoom)
    least_px = _SMALLEST_SQUARE * zoom
    if seen is not None and seen.side_px < least_px:
        return Finding(code=Code.SQUARES_TOO_SMALL, figures={**seen.figures, "least_px": least_px})
    if too_bright:
        return Finding(code=Code.TOO_BRIGHT)
    blurred = _is_nothing_sharp(pyramid) or _is_blurred(image, seen, zoom)
    return _explain_sharpness(seen, blurred=blurred, crossings=len(found.refused))


def _explain_sharpness(seen: _Squares | None, *, blurred: bool, crossings: int) -> Finding:
    """What is wrong with a photo that is light enough, whose squares are large enough, if any."""
    code = Code.BLURRED if blurred else Code.NO_CHECKERBOARD
    if seen is not None and seen.is_likely_a_board:
        return Finding(code=code, case="grid", figures=seen.figures)
    return Finding(code=code if blurred or crossings else Code.NO_CORNER)


def _find_zoom(image: npt.NDArray[np.generic], most: int) -> int:
    """How many times smaller, by halves, a photo has no more than so many pixels."""
    zoom = 1
    while image.size > most * zoom * zoom:
        zoom *= 2
    return zoom


def _look_at_scales(image: npt.NDArray[np.generic], finest: int) -> _Squares | None:
    """The squares that hang together and fill most of a photo, at any scale; None of none.

    Coarse scales come first: where squares are large enough there, a finer one shows no more. Fewer
    squares than are surely a grid's count where they are smallest, at the finest scale.
    """
    best, at = None, 4 * max(finest, _find_zoom(image, _COARSE_PIXELS))
    while at > finest and (best is None or best.side_px < _LARGE_PX * at):
        at //= 2
        if min(image.shape) < SMALLEST_SIDE * at:
            continue
        pieces = _find_squares(build_pyramid(reduced(image, at)), at)
        sure = [one for one in pieces if one.is_likely_a_board]
        best = max([*sure, *([best] if best else [])], key=lambda one: one.area, default=None)
        if best is None and at == finest and pieces:
            return pieces[0]
    return best


def _find_squares(pyramid: Pyramid, zoom: int) -> list[_Squares]:
    """The largest pieces of grids in a photo that was reduced by a zoom."""
    corners = find_corners(pyramid)
    found = []
    for patch in find_patches(pyramid, corners)[:_PIECES]:
        lattice = patch.lattice(corners)
        clean(lattice)
        cells = lattice.cells()
        if not is_regular(lattice, cells):
            continue
        fit = lattice.fit(cells)
        pixel = enlarged(lattice.at(cells), zoom)
        blur = refine_pixels(pyramid, lattice.at(cells), fit).blur.max(1)
        columns, rows = sorted(np.ptp(cells, axis=0) + 1, reverse=True)
        found.append(
            _Squares(
                corners=len(cells),
                columns=int(columns),
                rows=int(rows),
                low=pixel.min(axis=0),
                high=pixel.max(axis=0),
                side_px=zoom * float(np.median(fit.side)),
                blur_px=zoom * float(np.median(blur)),
                zoom=zoom,
            )
        )
    return found


def _is_noise(pyramid: Pyramid, contrast: float) -> bool:
    """Tell whether a photo's contrast, in its own grey levels, is hardly more than its noise.

    What noise is estimated from fades at half the size, unlike texture.
    """
    if contrast * pyramid.gain >= _FLAT * pyramid.noise:
        return False
    return len(pyramid.levels) > 1 and estimate_noise(pyramid.levels[1]) < 0.5 * pyramid.noise


def _is_nothing_sharp(pyramid: Pyramid) -> bool:
    """Tell whether even the sharpest edges of a photo are several pixels wide.

    Where the camera moved, those along its motion are sharp all the same: each direction counts.
    """
    if len(pyramid.levels) < 4:
        return False
    small, smallest = _find_steepest(pyramid.levels[1]), _find_steepest(pyramid.levels[3])
    edges = smallest > _LEAST_EDGE * max(small.max(), smallest.max())
    return bool((smallest > _SLOPE_GROWTH * small)[edges].any())


def _is_blurred(image: npt.NDArray[np.generic], seen: _Squares | None, finest: int) -> bool:
    """Tell whether there are squares, blurred and not made up of what is sharp at a finer scale."""
    if seen is None:
        return False
    if seen.zoom == finest:
        return seen.blur_px > USUAL_BLUR * seen.side_px
    (left, top), (right, bottom) = np.maximum([seen.low, seen.high], 0).astype(int)
    part = image[top : bottom + 1, left : right + 1]
    return _is_nothing_sharp(build_pyramid(reduced(part, finest)))


def _find_steepest(level: Float32Array) -> FloatArray:
    """(_DIRECTIONS,) the steepest slopes towards directions that share half a turn."""
    along, down = (cv2.Sobel(level, cv2.CV_32F, 1 - k, k, ksize=3) for k in (0, 1))
    turns = np.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    slopes = (np.cos(turn) * along + np.sin(turn) * down for turn in turns)
    return np.array([np.percentile(np.abs(slope), 99.9) for slope in slopes])


def _are_dark_squares_apart(burnt: npt.NDArray[np.bool_]) -> bool:
    """Tell whether dark squares stand alone in burnt-out white as those of a chequerboard would.

    Each has others like it on opposite sides, at equal distances, and these lie beyond its
    corners. Windows in a wall lie beyond each other's sides; letters are neither full nor alike.
    """
    # Components, each with its holes: what stands in a hole is a component of its own.
    dark = (~burnt).astype(np.uint8)
    contours, tree = cv2.findContours(dark, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    spots = []
    for contour, (*_, parent) in zip(contours, [] if tree is None else tree[0], strict=True):
        if parent >= 0:
            continue
        (x, y), (width, height), degrees = cv2.minAreaRect(contour)
        full = cv2.contourArea(contour) >= max(_LEAST_AREA, _FULL * width * height)
        if full and 1 / _LONG < width / height < _LONG:
            spots.append((x, y, np.radians(degrees), width * height))
    if len(spots) < _LEAST_SPOTS:
        return False
    place, turn, area = np.split(np.array(spots), [2, 3], axis=1)
    paired, towards, _ = find_opposite_pairs(place, area[:, 0], 5)
    corner = np.arctan2(towards[..., 1], towards[..., 0]) - turn
    off: FloatArray = np.abs((corner + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi)
    return bool(
        (paired.sum(1) >= 2).sum() >= _LEAST_SPOTS // 2 and np.median(off[paired]) > np.pi / 6
    )
