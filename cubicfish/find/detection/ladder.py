"""The scales that a photo is searched at, and the parts of it that are searched at one of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.pyramid import (
    CLOSE,
    SMALLEST_SIDE,
    Pyramid,
    build_pyramid,
    reduced,
)
from cubicfish.types import FloatArray

# The search begins at about so many pixels, where a board that fills a good part of the photo
# has squares of ten pixels.
COARSE_PIXELS = 130_000
# Nothing is searched at more.
MOST_PIXELS = 16_000_000
# cv2.remap takes no more.
_LONGEST_SIDE = 32_766


@dataclass(frozen=True, kw_only=True, eq=False)
class Ladder:
    """A grey photo (H, W), and its pyramids at several zooms.

    At a zoom of z the photo is z times smaller: pixel x of it lies at ``(x + 0.5) * z - 0.5``.
    """

    image: npt.NDArray[np.generic]
    _made: dict[float, Pyramid] = field(default_factory=dict)

    @property
    def coarsest(self) -> int:
        """Where the search begins."""
        return max(1, round((self.image.size / COARSE_PIXELS) ** 0.5))

    @property
    def finest(self) -> int:
        """The photo's own size, or the largest that is searched."""
        return max(1, int(np.ceil((self.image.size / MOST_PIXELS) ** 0.5)))

    def is_possible(self, zoom: float) -> bool:
        """Whether the photo at this zoom is neither too small nor too large to be searched."""
        shortest, longest = sorted(side / zoom for side in self.image.shape)
        fits = shortest * longest <= MOST_PIXELS and longest <= _LONGEST_SIDE
        return fits and shortest >= 2 * SMALLEST_SIDE

    def finer(self, zoom: float) -> list[float]:
        """The zooms below this one, the largest first, down to twice the photo's size."""
        zooms: list[float] = []
        while zoom > self.finest:
            zoom = max(zoom // 2, self.finest)
            zooms.append(zoom)
        return [*zooms, CLOSE] if self.is_possible(CLOSE) else zooms

    def at(self, zoom: float) -> Pyramid:
        """The whole photo at a zoom; made when it is first asked for."""
        if zoom not in self._made:
            self._made[zoom] = build_pyramid(reduced(self.image, zoom))
        return self._made[zoom]


@dataclass(frozen=True, kw_only=True)
class Box:
    """A part of a photo, its pixels: left and top belong to it, right and bottom do not."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def around(cls, pixel: FloatArray, margin: float, shape: tuple[int, ...]) -> Box:
        """Hold pixels (N, 2) and what is near them, within a photo (H, W)."""
        low = np.maximum(np.floor(pixel.min(axis=0) - margin), 0)
        high = np.minimum(np.ceil(pixel.max(axis=0) + margin) + 1, shape[::-1])
        return cls(left=int(low[0]), top=int(low[1]), right=int(high[0]), bottom=int(high[1]))

    def meets(self, other: Box) -> bool:
        """Whether they share pixels."""
        across = self.left < other.right and other.left < self.right
        return across and self.top < other.bottom and other.top < self.bottom

    def joined(self, other: Box) -> Box:
        """The smallest box with both."""
        return Box(
            left=min(self.left, other.left),
            top=min(self.top, other.top),
            right=max(self.right, other.right),
            bottom=max(self.bottom, other.bottom),
        )


def join_boxes(boxes: list[Box]) -> list[Box]:
    """Boxes that share no pixels, with all that these have."""
    apart: list[Box] = []
    for box in boxes:
        while touching := [one for one in apart if one.meets(box)]:
            for one in touching:
                apart.remove(one)
                box = box.joined(one)
        apart.append(box)
    return apart
