"""Why photos, or boards in photos, do not fit the lens of the others.

Where photos fit no lens together, the module finds those that do without some others, which have a
lens of their own.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cubicfish.diagnosis.mirrored import handed
from cubicfish.diagnosis.object_faults import COUNTED, ORDERS, flat_points
from cubicfish.diagnosis.two_lenses import lens_change
from cubicfish.errors import FitError
from cubicfish.fit.calibration import FailedFit, FitEvidence
from cubicfish.fit.radial_reference import RadialReference, fit_radial
from cubicfish.fit.start import fit_poses
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.adjustment import Adjustment
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.statistics import noise_px, rms_px
from cubicfish.solve.subset import flatness, select, select_photos
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

# Other ways of counting that are tried: some lines further on, and every order of both axes.
_LINES = range(-3, 4)
_STEPS = sorted(
    ((x, y) for x in _LINES for y in _LINES if x or y), key=lambda at: abs(at[0]) + abs(at[1])
)
FEWEST_CORNERS = 8
"""A board of fewer corners in a photo is not judged."""
# So many corners of a board, and such a share of them, are no single slips in a photo.
_FEWEST_LOST, _LOST_SHARE = 4, 0.5
# A corner under its right name is within this many standard deviations.
_NEAR = 6.0
# A board that moved is as sharp as the others: photos this many times as noisy are blurred.
_CLEAN = 3.0
_FEWEST_PHOTOS = 3
_MOST_LEFT_OUT = 30
# A fault in this share of a board's photos is the nominal target's.
_NEARLY_ALL_PHOTOS = 0.8
# A lens of their own says nothing about fewer photos of one flat board.
_FEWEST_OF_A_PLANE = 3
# Photos that do not fit have no more than this share of their squared error by themselves.
_HALF = 0.5
# From this share of the photos on, those that were left out say that the camera is wrong.
_MANY_LEFT_OUT = 1 / 3
_SURE_FOCAL = 0.03
# Lenses whose scales differ by less are distinguished by their centres only.
_SAME_FOCAL = 0.003
_TYPICAL_NOISE = 4.0
# Boards whose corners leave a plane by less than this share of their extent count as flat.
_FLAT = 1e-4
# Photos agree with a lens if their noise is within this many times that of the best ones.
_AGREES = 6.0
# Number of places in the photos' order at which neighbours are tried, and number of lenses that are
# tried on all photos.
_MOST_RUNS = 12
_MOST_LENSES = 8


# The fault of the nominal target if the corners of a board are named in this way in all photos; any
# other way is another order.
_FAULT_OF_NOMINAL = {
    "columns": Code.BOARD_PLACE,
    "rows": Code.BOARD_PLACE,
    "both": Code.BOARD_PLACE,
    "other_board": Code.BOARD_NAMES,
}


def board_fault(
    camera: RadialCamera, pairs: Observations, target: Target, scale: float, noise: float
) -> Finding | None:
    """Find why one photo does not fit, if one of its boards, or the names of all, are to blame.

    Args:
        camera: the lens of the photos that fit.
        pairs: pairs of one photo, divided by ``scale``.
        target: the calibration target.
        scale: the target's units in one unit of the pairs.
        noise: standard deviation of a corner's coordinate in photos that fit, pixels.

    """
    boards, counts = np.unique(pairs.board, return_counts=True)
    for board in boards[np.argsort(counts, kind="stable")]:
        others, _ = select(pairs, pairs.board != board)
        own, _ = select(pairs, pairs.board == board)
        if min(len(others.pixel), len(own.pixel)) < FEWEST_CORNERS:
            continue
        fit = _fit_sharply(camera, others, noise)
        fault = None if fit is None else _blame_board(camera, fit, own, target, scale, noise)
        if fault is not None:
            return fault
    # Or the corners of all its boards are counted from one line further on.
    plain = all(target.boards[board].points is None for board in boards)
    for step in _STEPS[:8] if plain and len(boards) > 1 else []:
        world = np.empty_like(pairs.world)
        for board in boards:
            here = pairs.board == board
            counted = pairs.column[here] + float(step[0]), pairs.row[here] + float(step[1])
            world[here] = flat_points(target.boards[board], *counted) / scale
        fit = _fit_sharply(camera, pairs.with_world(world), noise)
        if fit is not None:
            figures = {"error_px": noise_px(fit.residual), **_describe_step(step)}
            return Finding(
                code=Code.CORNER_NAMES, case="all_boards", images=pairs.images, figures=figures
            )
    return None


def _blame_board(
    camera: RadialCamera,
    fit: Adjustment[FixedLens],
    own: Observations,
    target: Target,
    scale: float,
    noise: float,
) -> Finding | None:
    """Find why one board, with pairs of its own, does not fit where the others of its photo do.

    ``fit`` is theirs; the rest is as for :func:`board_fault`.
    """
    board = target.boards[own.board[0]]
    blame = partial(Finding, images=own.images, boards=(board.name,))
    best: dict[str, Any] = {}
    least = np.inf
    for naming, points in _rename_corners(own, target):
        miss = camera.project(fit.poses.apply(own.image, points / scale)) - own.pixel
        length = np.hypot(miss[:, 0], miss[:, 1])
        error = float(np.median(np.where(np.isfinite(length), length, np.inf)))
        # Of two that fit, the simpler one, unless the other fits clearly better.
        if error < _NEAR * 2 * noise and error < 0.5 * least:
            best, least = naming, error
    if best:
        return blame(code=Code.CORNER_NAMES, figures={"error_px": least, **best})
    # Corners that are no clean board by themselves are blurred, and do not show a place.
    alone, _, _ = fit_poses(camera, own)
    if alone is None or noise_px(np.vstack([fit.residual, alone.residual])) > _CLEAN * noise:
        return None
    return blame(code=Code.BOARD_PLACE, case="moved")


def board_findings(
    faults: Sequence[Finding], is_usual: Callable[[str, int], bool]
) -> list[Finding]:
    """Report the same fault of several photos together.

    Args:
        faults: results of :func:`board_fault`, each of another photo.
        is_usual: whether a fault of a board (by name) in so many photos is in nearly all that show
            it, so that the nominal target is to blame.

    """
    alike: defaultdict[object, list[Finding]] = defaultdict(list)
    for fault in faults:
        same = frozenset(one for one in fault.figures.items() if one[0] != "error_px")
        alike[fault.boards, same].append(fault)
    findings = []
    for own in alike.values():
        fault, figures = own[0], dict(own[0].figures)
        if figures:
            figures["error_px"] = max(one.figures["error_px"] for one in own)
        together = replace(fault, images=sum((one.images for one in own), ()), figures=figures)
        if fault.boards and is_usual(fault.boards[0], len(own)):
            code, case = fault.code, "in_most"
            if figures:
                named = figures.pop("named")
                code, case = _FAULT_OF_NOMINAL.get(named, Code.BOARD_ORDER), "of_photos"
                figures["order" if code == Code.BOARD_ORDER else "named"] = named
            figures = {"photos": len(own), **figures}
            together = replace(
                together, code=code, case=case, severity=Severity.CARE, figures=figures
            )
        findings.append(together)
    return findings


def _describe_step(step: tuple[int, int]) -> dict[str, Any]:
    columns, rows = step
    return {
        "column_steps": abs(columns),
        "columns_far": columns < 0,
        "row_steps": abs(rows),
        "rows_far": rows < 0,
        "named": "both" if columns and rows else "columns" if columns else "rows",
    }


def _rename_corners(
    own: Observations, target: Target
) -> Iterator[tuple[dict[str, Any], FloatArray]]:
    """Yield other names for the corners of one board, and the world points under these names."""
    board = target.boards[own.board[0]]
    if board.points is not None:
        return
    c, r = own.column.astype(float), own.row.astype(float)
    for step in _STEPS:
        yield _describe_step(step), flat_points(board, c + step[0], r + step[1])
    for order in COUNTED:
        counted = ORDERS[order](c, r, board.columns, board.rows)
        yield {"named": order.removesuffix("_back")}, flat_points(board, *counted)
    for other in target.boards:
        if other is not board and other.points is None:
            yield {"other": other.name, "named": "other_board"}, flat_points(other, c, r)


def _fit_sharply(
    camera: RadialCamera, pairs: Observations, noise: float
) -> Adjustment[FixedLens] | None:
    """The poses of all photos, if their corners fit nearly as well as those of others."""
    fit, placed, _ = fit_poses(camera, pairs)
    if fit is None or len(placed.pixel) < len(pairs.pixel):
        return None
    return fit if noise_px(fit.residual) < _NEAR * noise else None


def left_out(evidence: FitEvidence) -> list[Finding]:
    """Find why photos, or boards in photos, do not fit the lens of the others."""
    pairs, fit, nominal = evidence.pairs, evidence.fit, evidence.fit.nominal
    mirrored = {name for one in handed(evidence) for name in one.images}
    names = _find_left_out(evidence) - mirrored
    camera, noise = fit.reference.camera, noise_px(fit.reference.residual)
    scaled = pairs.with_world(pairs.world / nominal.scale)
    unfit = _list_photos(pairs, names & ({*fit.reference.unfit} | _find_mostly_dropped(evidence)))
    own = None
    if unfit.size:
        silent = {
            name for name, why in fit.reference.unfit.items() if why.code == Code.TOO_FEW_CORNERS
        }
        order = [name for name in pairs.images if name not in silent]
        own = left_out_lens(camera, select_photos(scaled, unfit), noise, order=order)
    findings = [] if own is None else [own]
    if nominal.target is None:
        return findings
    photos = _list_photos(pairs, names.difference(*(one.images for one in findings)))
    tried = photos[:_MOST_LEFT_OUT]
    singly = (select_photos(scaled, np.array([photo])) for photo in tried)
    faults = (board_fault(camera, one, nominal.target, nominal.scale, noise) for one in singly)
    is_usual = partial(_is_usual, pairs, tried, photos)
    return findings + board_findings([fault for fault in faults if fault is not None], is_usual)


def _list_photos(pairs: Observations, names: set[str]) -> IntArray:
    """The photos of these names, by their numbers."""
    return np.flatnonzero([name in names for name in pairs.images])


def _is_usual(
    pairs: Observations, tried: IntArray, photos: IntArray, name: str, times: int
) -> bool:
    """Whether so many of the tried photos that show a board are nearly all of those that do.

    ``photos`` are all that were left out, whether they were tried or not.
    """
    own = pairs.image[pairs.board == pairs.boards.index(name)]
    shown = np.flatnonzero(np.bincount(own) >= FEWEST_CORNERS)
    among, lost = (np.isin(shown, some).sum() for some in (tried, photos))
    return bool(times >= _FEWEST_PHOTOS and times * lost >= _NEARLY_ALL_PHOTOS * among * len(shown))


def _find_left_out(evidence: FitEvidence) -> set[str]:
    """The photos that were left out, and those in which a board lost half of its corners."""
    pairs, unfit = evidence.pairs, evidence.fit.reference.unfit.items()
    names = {name for name, why in unfit if why.code != Code.TOO_FEW_CORNERS}
    lost = Counter((one.board, one.image) for one in evidence.dropped if one.board is not None)
    for (board, photo), count in lost.items():
        seen = pairs.image[pairs.board == pairs.boards.index(board)]
        corners = int((seen == pairs.images.index(photo)).sum())
        if count >= max(_FEWEST_LOST, _LOST_SHARE * corners):
            names.add(photo)
    return names


def _find_mostly_dropped(evidence: FitEvidence) -> set[str]:
    """The photos that lost half of their corners: with few corners the rest may fit any lens."""
    corners = np.bincount(evidence.pairs.image, minlength=len(evidence.pairs.images))
    lost = Counter(one.image for one in evidence.dropped)
    return {
        name
        for name, count in zip(evidence.pairs.images, corners, strict=True)
        if lost[name] >= max(_FEWEST_LOST, _LOST_SHARE * count)
    }


def left_out_lens(
    camera: RadialCamera, pairs: Observations, noise: float, *, order: Sequence[str]
) -> Finding | None:
    """Find whether photos that do not fit do fit a lens of their own.

    Args:
        camera: the lens of the photos that fit.
        pairs: pairs of the photos that do not.
        noise: standard deviation of a corner's coordinate in those that fit, pixels.
        order: the names of all photos, in order.

    """
    own = _fit_own_lens(pairs, noise)
    if own is None:
        return None
    angle = np.linspace(0.1, own.covered, 30)
    radii = [lens.fx * lens.profile(angle) for lens in (camera, own.camera)]
    centres = [np.array([lens.cx, lens.cy]) for lens in (camera, own.camera)]
    ratio, shift = float(np.median(radii[1] / radii[0])), centres[1] - centres[0]
    if abs(ratio - 1) < _SAME_FOCAL and np.hypot(*shift) < 1:
        return None
    if not _is_clearly_other(camera, own):
        return None
    names = list(own.pairs.images)
    because, centre = "own_lens", centres[0]
    first = list(order[: len(names)]) == names
    if first and len(names) < len(order):  # those before the others, compared with these
        names = list(order[len(names) :])
        ratio, shift, centre = 1 / ratio, -shift, centres[1]
        because = "own_lens_before"
    found = lens_change(
        ratio,
        shift,
        centre,
        names,
        [name for name in order if name not in names],
        pairs,
        in_order=first or list(order[-len(names) :]) == names,
        because=because,
        figures={"own_px": rms_px(own.residual)},
    )
    # The camera is that of the others, and right, unless the others may be the odd ones.
    many = len(own.pairs.images) >= _MANY_LEFT_OUT * len(order)
    return found if many else replace(found, severity=Severity.CARE)


def _fit_own_lens(pairs: Observations, noise: float) -> RadialReference | None:
    """The lens of photos that fit it as others fit theirs; None where there is no sure one."""
    if flatness(pairs.world) < _FLAT and len(pairs.images) < _FEWEST_OF_A_PLANE:
        return None
    try:
        own = fit_radial(pairs)
    except (FitError, np.linalg.LinAlgError):
        return None
    unsure = own.focal_uncertainty > _SURE_FOCAL or noise_px(own.residual) > _TYPICAL_NOISE * noise
    return None if unsure else own


def _is_clearly_other(camera: RadialCamera, own: RadialReference) -> bool:
    """Whether photos fit their own lens clearly better than another one, with free poses."""
    fit, placed, _ = fit_poses(camera, own.pairs)
    if fit is None or len(placed.pixel) < len(own.pairs.pixel):
        return True
    return noise_px(own.residual) ** 2 < _HALF * noise_px(fit.residual) ** 2


def failed_lens(evidence: FailedFit) -> list[Finding]:
    """Find some photos that agree on a lens, and others that do not, if there are any."""
    pairs, _ = evidence.scaled
    count = len(pairs.images)
    if count <= _FEWEST_PHOTOS:
        return []
    lenses = []
    for few in _list_subsets(count):
        try:
            lens = fit_radial(select_photos(pairs, few), thorough=False)
        except (FitError, np.linalg.LinAlgError):
            continue
        if lens.focal_uncertainty < _SURE_FOCAL:
            lenses.append(lens)
    if not lenses:
        return []
    noise = min(noise_px(lens.residual) for lens in lenses)
    alike = [lens for lens in lenses if noise_px(lens.residual) <= 2 * noise]
    surest = sorted(alike, key=lambda lens: lens.focal_uncertainty)[:_MOST_LENSES]
    agreeing = max((_find_agreeing(lens, pairs, noise) for lens in surest), key=len)
    if not _FEWEST_PHOTOS <= len(agreeing) < count:
        return []
    lens = fit_radial(select_photos(pairs, agreeing))
    others = np.setdiff1d(np.arange(count), agreeing)
    found = left_out_lens(
        lens.camera, select_photos(pairs, others), noise_px(lens.residual), order=pairs.images
    )
    if found is not None:
        return [found]
    return [
        Finding(
            code=Code.PHOTO_LENS,
            case="left_out",
            severity=Severity.BAD,
            images=tuple(pairs.images[photo] for photo in others),
            figures={"others": len(agreeing), "noise_px": noise_px(lens.residual)},
        )
    ]


def _list_subsets(count: int) -> Iterable[IntArray]:
    """Yield a few photos at a time: neighbours, every second or third one, and at random."""
    size = max(_FEWEST_PHOTOS, min(6, count // 3))
    starts = np.arange(0, max(count - size, 0) + 1, max(1, size // 2))
    for first in starts[np.unique(np.linspace(0, len(starts) - 1, _MOST_RUNS).astype(int))]:
        yield np.arange(first, min(first + size, count))
    for step in (2, 3):
        for first in range(step):
            yield np.arange(first, count, step)[:size]
    rng = np.random.default_rng(0)
    for _ in range(12):
        yield np.sort(rng.choice(count, min(_FEWEST_PHOTOS, count), replace=False))


def _find_agreeing(lens: RadialReference, pairs: Observations, noise: float) -> IntArray:
    fit, own, placed = fit_poses(lens.camera, pairs)
    if fit is None:
        return np.zeros(0, np.intp)
    limit = _AGREES * max(noise, 1e-3)
    good = [
        photo
        for number, photo in enumerate(placed)
        if noise_px(fit.residual[own.image == number]) <= limit
    ]
    return np.array(good, np.intp)
