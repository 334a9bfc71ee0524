"""Windows of different sizes, in few groups that numpy works on at once."""

import numpy as np

from cubicfish.types import IntArray

# Rather so many pixels in vain than a set of calls more, which costs about as much.
_MOST_IN_VAIN = 4_000


def group_windows(radius: IntArray) -> list[tuple[int, IntArray]]:
    """Put square windows of radius (N,), 2 radius + 1 pixels wide, into few groups.

    Returns:
        For each group the radius that serves all of it, and which windows are in it.

    """
    counts = np.bincount(radius)
    sizes = np.flatnonzero(counts)
    counts = counts[sizes]
    pixels = (2 * sizes + 1) ** 2
    last = np.ones(len(sizes), bool)  # of the sizes of a group: the one that serves all
    carried = spent = 0
    for k in range(len(sizes) - 1):
        carried += counts[k]
        spent += carried * (pixels[k + 1] - pixels[k])
        last[k] = spent > _MOST_IN_VAIN
        if last[k]:
            carried = spent = 0
    serving = sizes[last]
    of = np.searchsorted(serving, radius)
    return [(int(size), np.flatnonzero(of == k)) for k, size in enumerate(serving)]
