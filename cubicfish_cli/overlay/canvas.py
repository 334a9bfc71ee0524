"""A dimmed photo to draw on: marks and legible text, sized to suit the photo."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.photos import Picture
from cubicfish_cli.types import BoolArray, FloatArray

ColourPicture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]  # blue, green, red

WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)

_SHIFT = 4  # cv2 draws to 1/16 pixel
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_CAPITAL = 22  # height of its capitals at scale 1, pixels
# The background's brightest level and how much its dark parts are raised.
_BRIGHTEST, _GAMMA = 135.0, 0.7
# Levels are spread no further than this share of the grey scale: noise stays dark.
_LEAST_SPAN = 1 / 12


def local_contrast(picture: Picture, pixel: FloatArray) -> FloatArray:
    """Brightest minus darkest level (N,) some pixels around (N, 2) pixels, noise smoothed away."""
    smooth = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 1.5)
    around = np.ones((9, 9), np.uint8)
    reach = np.asarray(cv2.dilate(smooth, around)) - np.asarray(cv2.erode(smooth, around))
    height, width = picture.shape
    x, y = np.clip(np.rint(pixel).astype(int), 0, (width - 1, height - 1)).T
    return np.asarray(reach[y, x], float)


class PhotoCanvas:
    """A photo in grey, half as bright as it was, and what is drawn over it.

    Attributes:
        pixels: (H, W, 3) the drawing, in BGR order.
        unit: width of a thin line, pixels: about a thousandth of the photo's longer side.
        text_height: height of a capital letter, pixels.

    """

    def __init__(self, picture: Picture) -> None:
        """Dim ``picture``, (H, W) of 8 or 16 bits."""
        self.pixels: ColourPicture = np.repeat(_dimmed(picture)[..., None], 3, axis=2)
        longer = max(picture.shape)
        self.unit = max(longer / 1000, 1.0)
        self._scale = max(0.5 * longer / 1000, 0.4)
        self.text_height = _CAPITAL * self._scale
        self._taken: list[FloatArray] = []

    def lines(
        self, paths: Sequence[FloatArray] | FloatArray, colour: Colour, width: float, *,
        closed: bool = False,
    ) -> None:  # fmt: skip
        """Draw (N, 2) paths of pixels with round ends, ``width`` pixels wide."""
        fixed = [_fixed(path) for path in paths]
        if fixed:
            thickness = max(round(width), 1)
            cv2.polylines(self.pixels, fixed, closed, colour, thickness, cv2.LINE_AA, _SHIFT)

    def outlined(
        self, paths: Sequence[FloatArray] | FloatArray, colour: Colour, width: float, *,
        closed: bool = False,
    ) -> None:  # fmt: skip
        """Draw paths as :meth:`lines` does, with a dark seam that shows on bright squares."""
        self.lines(paths, BLACK, width + 2 * max(round(0.6 * self.unit), 1), closed=closed)
        self.lines(paths, colour, width, closed=closed)

    def dots(self, pixel: FloatArray, colour: Colour, radius: float) -> None:
        """Draw a filled disc at each of (N, 2) pixels."""
        self.lines(np.stack([pixel, pixel], axis=1), colour, 2 * radius)

    def polygon(self, corners: FloatArray, colour: Colour) -> None:
        """Fill a convex polygon of (N, 2) pixels."""
        cv2.fillConvexPoly(self.pixels, _fixed(corners), colour, cv2.LINE_AA, _SHIFT)

    def text_size(self, text: str) -> FloatArray:
        """(2,) width and height of a text's plate, pixels."""
        return np.array([self._width(text), self.text_height]) + 2 * self._margin

    def reserve(self, middle: FloatArray, radius: float) -> None:
        """Keep texts away from a mark."""
        self._taken.append(np.concatenate([middle - radius, middle + radius]))

    def inside(self, pixel: FloatArray) -> BoolArray:
        """(N,) which of (N, 2) pixels lie in the picture."""
        return np.asarray(((pixel >= 0) & (pixel < self.pixels.shape[1::-1])).all(axis=-1))

    def plate(
        self,
        text: str,
        middles: Sequence[FloatArray] | FloatArray,
        colour: Colour,
        *,
        filled: bool = False,
        insist: bool = False,
    ) -> bool:
        """Write a text on a plate at the first of several places that no other text has.

        Args:
            text: what is written; letters other than ASCII become question marks.
            middles: pixels (2,) where the plate's middle may be, the best one first; they are
                moved as far as the plate needs to lie within the picture.
            colour: of the text, or of the plate.
            filled: whether the plate has the colour, rather than the text.
            insist: whether to write at the first place where all are taken.

        Returns:
            Whether it was written.

        """
        size = self.text_size(text)
        room = np.maximum(np.array(self.pixels.shape[1::-1]) - size, 0)
        # (K, 4) left, top, right, bottom of the plate at each place.
        corner = np.clip(np.reshape(middles, (-1, 2)) - size / 2, 0, room)
        boxes = np.concatenate([corner, corner + size], axis=1)
        free = np.array([not self._is_taken(box) for box in boxes], bool)
        if not len(boxes) or not (free.any() or insist):
            return False
        box = boxes[np.argmax(free)]
        if filled:
            self._fill(box, colour, 0.0)
        else:
            self._fill(box, BLACK, 0.3)
        self._write(text, box, BLACK if filled else colour)
        self._taken.append(box)
        return True

    def caption(self, parts: Sequence[tuple[str, Colour]]) -> None:
        """Write texts one after the other at the top left, over at most a third of the photo."""
        gap, height = self._width("n") + self._margin, 1.6 * self.text_height
        lowest = max(self.pixels.shape[0] / 3 - height, 0)
        left, top, words = 0.0, 0.0, []
        # A part stays together where it can; one longer than a line is split into its words.
        for text, colour in parts:
            whole = self.text_size(text)[0] <= self.pixels.shape[1]
            for word in [text] if whole else text.split():
                right = left + self._width(word)
                if left and right + 2 * self._margin > self.pixels.shape[1]:
                    left, top, right = 0.0, top + height, right - left
                if top <= lowest:
                    words.append((word, np.array([left, top, right, top + height]), colour))
                left = right + (gap if whole else 0.7 * gap)
        box = np.max([place for _, place, _ in words], axis=0) + 2 * self._margin
        box[:2] = 0
        self._fill(box, BLACK, 0.3)
        for word, place, colour in words:
            self._write(word, place, colour)
        self._taken.append(box)

    @property
    def _thickness(self) -> int:
        return max(round(1.6 * self._scale), 1)

    @property
    def _margin(self) -> float:
        return 0.4 * self.text_height

    def _width(self, text: str) -> float:
        return float(cv2.getTextSize(_ascii(text), _FONT, self._scale, self._thickness)[0][0])

    def _is_taken(self, box: FloatArray) -> bool:
        return any((box[:2] < old[2:]).all() and (old[:2] < box[2:]).all() for old in self._taken)

    def _fill(self, box: FloatArray, colour: Colour, kept: float) -> None:
        """Cover a box, letting through a share of what is beneath."""
        left, top, right, bottom = np.round(box).astype(int).tolist()
        part = self.pixels[top:bottom, left:right]
        part[:] = np.round(kept * part + (1 - kept) * np.array(colour))

    def _write(self, text: str, box: FloatArray, colour: Colour) -> None:
        x = round(float(box[0] + self._margin))
        y = round(float(box[1] + box[3] + self.text_height) / 2)
        cv2.putText(
            self.pixels, _ascii(text), (x, y), _FONT, self._scale, colour, self._thickness,
            cv2.LINE_AA,
        )  # fmt: skip


def _dimmed(picture: Picture) -> ColourPicture:
    """The photo from black to half bright, its dark parts raised."""
    full = 65_535 if picture.dtype == np.uint16 else 255
    step = max(min(picture.shape) // 500, 1)
    low, high = np.percentile(picture[::step, ::step], [1, 99])
    low = min(low, high / 2)  # a photo that is all bright stays bright
    spread = (np.arange(full + 1) - low) / max(high - low, _LEAST_SPAN * full)
    levels = np.round(_BRIGHTEST * np.clip(spread, 0, 1) ** _GAMMA).astype(np.uint8)
    return np.asarray(levels[picture])


def _fixed(path: FloatArray) -> npt.NDArray[np.int32]:
    return np.round(np.asarray(path) * (1 << _SHIFT)).astype(np.int32)


def _ascii(text: str) -> str:
    """cv2's fonts hold ASCII only."""
    return text.encode("ascii", "replace").decode()
