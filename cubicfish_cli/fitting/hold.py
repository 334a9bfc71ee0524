"""How P is held: by how symmetric a lens, and how firmly. Two unknowns of each camera.

Asymmetry is real on some lenses and absent on others, and what corners can tell of it depends on
how many there are and on what errors they share. So both are chosen by what photos that are left
out say, from the plain radial lens at one end to a nearly free P at the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.companion import Companion
from cubicfish_cli.fitting.cubic_fit import CubicResult, Hold, fit_cubic
from cubicfish_cli.fitting.left_out import left_out
from cubicfish_cli.fitting.robust import huber_px
from cubicfish_cli.fitting.statistics import rms_px
from cubicfish_cli.fitting.world import World

IntArray = npt.NDArray[np.intp]

# From the most symmetric and the firmest on. A hundredth is far more asymmetry than any lens has
# that is sold; from a hundredth of a pixel's worth of weight on P is free.
SPREADS = (0.0, 1e-4, 1e-3, 1e-2)
WEIGHTS = tuple(10.0 ** (1.5 - step / 2) for step in range(8))
# Where photos that are left out cannot tell.
UNTOLD = Hold(spread=1e-3, weight=1.0)
# A step to a freer P must lower the error by this share: chance does by less.
_WORTH = 5e-4
# The scan ends when so many weaker holds in a row are worse.
_PATIENCE = 2
# What only leads to a choice need not be known to the last digit.
_SCAN_DECREASE = 1e-4

_Place = tuple[int, int]  # indices into SPREADS and WEIGHTS


def choose_hold(
    companion: Companion,
    groups: Sequence[IntArray],
    *,
    world: World | None = None,
    start: CubicResult | None = None,
) -> CubicResult:
    """Fit the cubic under the hold that photos left out speak for.

    Args:
        companion: the radial fit.
        groups: photos to be left out together; fewer than two leave the choice open.
        world: the object, where it is free.
        start: a fit to the same photos whose hold is where to begin; None to look everywhere.

    Raises:
        FitError: no hold gives a sound camera.

    """
    if len(groups) < 2:
        hold = UNTOLD if start is None else start.hold
        return fit_cubic(companion, hold, world=world, start=start)
    search = _Search(companion, groups, world, start)
    if start is None:
        best = search.down_the_weights(SPREADS.index(UNTOLD.spread))
    else:
        best = _place_of(start.hold)
    best = search.downhill(best)
    if best not in search.results:  # none is sound: say why
        return fit_cubic(companion, UNTOLD, world=world)
    return fit_cubic(
        companion, _hold(best), world=search.results[best].fit.world, start=search.results[best]
    )


def _hold(place: _Place) -> Hold:
    return Hold(spread=SPREADS[place[0]], weight=WEIGHTS[place[1]])


def _place_of(hold: Hold) -> _Place:
    weight = np.abs(np.log(WEIGHTS) - np.log(hold.weight)).argmin()
    return int(np.abs(np.array(SPREADS) - hold.spread).argmin()), int(weight)


class _Search:
    """Holds that were tried, each fit starting at the last."""

    def __init__(
        self,
        companion: Companion,
        groups: Sequence[IntArray],
        world: World | None,
        start: CubicResult | None,
    ) -> None:
        self._companion = companion
        self._groups = groups
        self._world = world
        self._last = start
        self.results: dict[_Place, CubicResult] = {}
        self._errors: dict[_Place, float] = {}

    def down_the_weights(self, spread: int) -> _Place:
        """The best weight of one spread, from firm to weak."""
        for weight in range(len(WEIGHTS)):
            self._error((spread, weight))
            tried = [self._error((spread, other)) for other in range(weight + 1)]
            if weight - int(np.argmin(tried)) >= _PATIENCE:
                break
        return min(self._errors, key=self._errors.__getitem__)

    def downhill(self, place: _Place) -> _Place:
        """From hold to neighbouring hold for as long as that lowers the error."""
        while True:
            spread, weight = place
            around = [
                (spread + step, weight + other)
                for step, other in ((-1, 0), (1, 0), (0, -1), (0, 1))
                if 0 <= spread + step < len(SPREADS) and 0 <= weight + other < len(WEIGHTS)
            ]
            best = min([place, *around], key=self._error)
            if best == place:
                return place
            place = best

    def _error(self, place: _Place) -> float:
        """RMS over corners of photos that are left out, a little more for a freer P."""
        if place not in self._errors:
            self._errors[place] = self._measured(place) * (1 + _WORTH * sum(place))
        return self._errors[place]

    def _measured(self, place: _Place) -> float:
        companion = self._companion
        try:
            result = fit_cubic(
                companion,
                _hold(place),
                world=self._world if self._last is None else self._last.fit.world,
                start=self._last,
                relative_decrease=_SCAN_DECREASE,
            )
        except FitError:
            return np.inf
        self.results[place] = self._last = result
        judged = left_out(result.fit, companion.pairs, huber_px(result.residual), self._groups)
        return rms_px(np.vstack([one.residual for one in judged]))
