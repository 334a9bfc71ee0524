"""Photos or targets in mirror image.

No lens turns a picture inside out: on every photo of a printed face the rows grow to the right of
the direction in which the columns grow, unless corners are in another order, or the photo is
mirrored.
"""

from dataclasses import replace

import numpy as np

from cubicfish.diagnosis.evidence import GridEvidence, grid_boards
from cubicfish.fit.calibration import CornerEvidence, FailedFit
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.statistics import neighbours, noise_px
from cubicfish.solve.subset import flatness
from cubicfish.target.observations import Observations
from cubicfish.types import IntArray

# Fewer squares than this, or a smaller majority of them, show nothing.
_FEWEST = 3
_MAJORITY = 0.9
_SURE_FOCAL = 0.03
# A target that leaves a plane by less looks the same in a mirror, seen from behind.
_FLAT = 1e-4


def handed(evidence: CornerEvidence) -> list[Finding]:
    """Find photos or boards that are seen as in a mirror, though the fit succeeded."""
    pairs = evidence.pairs
    sides = seen_sides(pairs)
    some = some_mirrored(sides, pairs)
    if some:
        return some
    if flatness(pairs.world) < _FLAT and (sides < 0).any() and not (sides > 0).any():
        return [Finding(code=Code.MIRRORED, case="behind", severity=Severity.CARE)]
    return []


def some_mirrored(sides: IntArray, pairs: Observations) -> list[Finding]:
    """Find photos that show boards in mirror image compared with most photos of the same boards."""
    usual = np.sign(sides.sum(axis=0))
    against = (sides * usual < 0).any(axis=1) & ~(sides * usual > 0).any(axis=1)
    known = (sides * usual != 0).any(axis=1)
    if not against.any() or 2 * against.sum() >= known.sum():
        return []
    names = tuple(pairs.images[photo] for photo in np.flatnonzero(against))
    return [Finding(code=Code.MIRRORED, case="some", images=names)]


def mirrored_photos(evidence: FailedFit) -> list[Finding]:
    """Find photos that show boards in mirror image, where there is no fit for that reason."""
    pairs, _ = evidence.scaled
    return some_mirrored(seen_sides(pairs), pairs)


def mirrored_object(evidence: FailedFit) -> list[Finding]:
    """Find that photos fit a lens and the mirror image of the target."""
    pairs, _ = evidence.scaled
    if flatness(pairs.world) < _FLAT:
        return []
    fit = fit_radial(in_mirror(pairs), thorough=False)
    if fit.focal_uncertainty > _SURE_FOCAL:
        return []
    return [
        Finding(
            code=Code.MIRRORED,
            case="points",
            severity=Severity.BAD,
            because="corrected",
            figures={"after_px": noise_px(fit.residual)},
        )
    ]


def in_mirror(pairs: Observations) -> Observations:
    """The pairs of photos with left and right exchanged."""
    return replace(pairs, pixel=pairs.pixel * [-1, 1] + [pairs.image_size[0] - 1, 0])


def other_colours(evidence: GridEvidence) -> list[Finding]:
    """Find that the only board is light where the target says that it is dark."""
    target = evidence.target
    if not evidence.other_colours:
        return []
    board = grid_boards(target.as_printed())[0]
    first = board.first_square
    finding = Finding(
        code=Code.MIRRORED,
        case="colours_in_mirror" if target.mirrored else "colours",
        boards=(board.name,),
        figures={
            "board": board.name,
            "first_square": first,
            "other": "light" if first == "dark" else "dark",
        },
    )
    return [finding]


def seen_sides(pairs: Observations) -> IntArray:
    """(photos, boards): 1 where a board is seen from its face, -1 mirrored, 0 where it is unknown.

    Boards whose corners have no rows and columns, such as lists of points, are never known.
    """
    photos, boards = len(pairs.images), max(len(pairs.boards), 1)
    sides = np.zeros((photos, boards), np.intp)
    if not len(pairs.pixel) or (pairs.board < 0).any():
        return sides
    right, down = neighbours(pairs)
    both = np.flatnonzero((right >= 0) & (down >= 0))
    along = pairs.pixel[right[both]] - pairs.pixel[both]
    across = pairs.pixel[down[both]] - pairs.pixel[both]
    sign = np.sign(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0])
    view = pairs.image[both] * boards + pairs.board[both]
    count = np.bincount(view, minlength=photos * boards)
    total = np.bincount(view, weights=sign, minlength=photos * boards)
    known = (count >= _FEWEST) & (np.abs(total) >= (2 * _MAJORITY - 1) * count)
    return np.where(known, np.sign(total), 0).astype(np.intp).reshape(photos, boards)
