"""Raw pictures of colour sensors, saved as grey ones before their mosaic was made into colours."""

from typing import Any

import numpy as np
import numpy.typing as npt

# Red, green and blue pixels differ by more than this share in nearly any light, and where pixels
# are many by more than so many standard errors of what chance would give.
_DIFFER, _ERRORS = 0.05, 6.0


def evened(grey: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A grey picture whose pixels do not differ by the colour of the filters before them.

    Boards are black and white: once the four kinds of pixels of a Bayer mosaic are as bright as
    each other, they look as a grey sensor sees them, at full sharpness.

    Args:
        grey: (H, W) uint8 or uint16.

    Returns:
        The same where it shows no mosaic; else a copy.

    """
    kinds = [(slice(row, None, 2), slice(column, None, 2)) for row in (0, 1) for column in (0, 1)]
    if min(grey.shape) < 2:
        return grey
    bright = np.array([grey[kind].mean() for kind in kinds])
    if bright.min() == 0 or np.ptp(bright) < _DIFFER * bright.min():
        return grey
    if np.ptp(bright) < _ERRORS * grey.std() / np.sqrt(grey.size / 4):
        return grey
    even = np.empty_like(grey)
    for kind, gain in zip(kinds, bright.mean() / bright, strict=True):
        even[kind] = np.clip(np.rint(grey[kind] * gain), 0, np.iinfo(grey.dtype).max)
    return even
