"""How far the camera would move without each photo, all that the fit chose held as it is.

Held are the prior's weight, what of the target is free and how firmly, the photos' weights and
which corners count. A new fit chooses these anew.
"""

import numpy as np

from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.uncertainty import Gauge
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.types import FloatArray

# Each photo alone costs a linear system. Of more photos one changes the equations little: then
# their part of the Hessian is kept, and a single system serves all.
_MOST_ALONE = 48
# Beyond this the steps of all poses, for all photos at once, would take hundreds of megabytes.
_MOST = 1000


def photo_shifts_px(fit: CameraFit, rays: FloatArray) -> list[float | None]:
    """How far distant points' pixels move where a photo is left out, to first order.

    A turn that lens and poses share does not count.

    Args:
        fit: the fit, at its optimum.
        rays: (N, 3) unit rays over the field, in the fit's frame.

    Returns:
        RMS over the rays for each photo, pixels; None where photos or rays are too few or too many.

    """
    photos = np.arange(len(fit.poses))
    if not 1 < len(photos) <= _MOST or not len(rays):
        return [None] * len(photos)
    alone = LeaveOneOut(fit, list(photos[:, None]))
    if len(photos) <= _MOST_ALONE:
        steps = np.array([shared for shared, _, _ in alone.steps()])
    else:
        steps = alone.influence()
    by_lens = Gauge.over(fit.lens, rays).by_lens(rays)
    moved = by_lens @ steps[:, : by_lens.shape[1]].T
    return [float(one) for one in np.linalg.norm(moved, axis=0) / np.sqrt(len(rays))]
