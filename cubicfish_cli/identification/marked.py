"""Objects with markers: ids name the corners photo by photo, without any geometry.

Boards without markers on the same object are named afterwards, in the second pass: by then the
marked boards have told the lens and where each photo was taken from.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cubicfish_cli.detection.markers import MarkedCorners
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target


def marked_corners(
    marked: Sequence[MarkedCorners],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
) -> Observations:
    """What markers named in each of the photos, as one table sorted by photo.

    Args:
        marked: one for each photo.
        target: the object.
        image_size: (width, height) of all photos, pixels.
        images: the photos' names.

    """
    image = np.repeat(np.arange(len(marked)), [len(one) for one in marked])
    board, column, row = (
        np.concatenate([getattr(one, name) for one in marked]).astype(np.intp)
        for name in ("board", "column", "row")
    )
    pixel = np.concatenate([one.pixel for one in marked])
    return (
        Observations(
            image_size=image_size,
            images=tuple(images),
            boards=target.board_names,
            image=image,
            board=board,
            column=column,
            row=row,
            pixel=pixel,
        )
        .with_target(target)
        .in_order()
    )
