"""Photos that were saved mirrored, turned by 180° or reduced, as the lens's centre shows.

A board looks like itself in a mirror, or upside down, and its corners are named by what is seen.
But no lens's centre is in the middle of the picture: it jumps to the other side of it, and with it
whatever else is lopsided about the lens.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from cubicfish.diagnosis.photo_lenses import (
    BY_CHANCE,
    ROUGH_DECREASE,
    lenses_of,
    photo_lenses,
    unlike,
)
from cubicfish.diagnosis.two_lenses import best_split
from cubicfish.fit.calibration import FitEvidence
from cubicfish.fit.cubic_fit import CameraFit, fit_cubic
from cubicfish.fit.radial_reference import refit_radial
from cubicfish.fit.start import fit_poses, unplaced
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.descent import COLD_DAMPING
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import local_noise_px, noise_by_photo, wide_px
from cubicfish.solve.subset import select_photos
from cubicfish.target.observations import Observations
from cubicfish.target.placement import renamed
from cubicfish.types import BoolArray, FloatArray, IntArray

# What becomes of a picture's x and y: as it is, left and right exchanged, top and bottom, both.
_WAYS = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]])
_TURNED = 3
# A photo that is put right has no more than this share of its squared error, and all photos have no
# more of what noise does not explain: it was what was wrong with them. Lenses of all photos follow,
# and show others: so many times at most.
_HALF, _ROUNDS = 0.5, 5
# The last step is one that gains a smaller share of the cost. Poses of photos that are put right
# are there in a few steps; those of others need tens to where they are wrong all the same. Only
# photos that some other way suits better are fitted on, to far less than what decides.
_ROUGHLY, _EXACTLY = 1e-3, 1e-6
# It then fits nearly as well as the others, so many times their squared error at most.
_AS_OTHERS = 4.0
# A lens's centre is this near to the middle of the picture, as a share of its longer side; one that
# is farther off than so many times that has another reason.
_NEAR, _FAR = 0.01, 3.0


def saved_otherwise(evidence: FitEvidence) -> list[Finding]:
    """Find photos that are mirrored or turned, unlike most: put right, they fit one lens."""
    fit, nominal_fit = evidence.fit, evidence.nominal_fit
    # A target bends to photos of which one is mirrored; the nominal one may be far from the real.
    for one in (fit,) if fit is nominal_fit else (nominal_fit, fit):
        if found := _find_otherwise(one, evidence.pairs):
            return found
    return []


def reduced(evidence: FitEvidence) -> list[Finding]:
    """Find that all that is seen lies in a smaller picture, whose middle is the lens's centre."""
    reference = evidence.fit.reference
    size, camera = np.array(evidence.pairs.image_size), reference.camera
    middle, centre = (size - 1) / 2, np.array([camera.cx, camera.cy])
    near = _NEAR * size.max()
    if (middle - centre < _FAR * near).any() or (centre <= 0).any():
        return []
    share = float(np.sqrt(np.prod(centre / middle)))
    is_middle = np.abs(centre - middle * share).max() < near
    if not is_middle or (evidence.pairs.pixel.max(axis=0) > size * share + 2 * near).any():
        return []
    (width, height), (x, y) = np.rint(size * share).astype(int).tolist(), centre.tolist()
    figures = {"width": width, "height": height, "x_px": x, "y_px": y}
    figures |= {"given_width": int(size[0]), "given_height": int(size[1])}
    return [Finding(code=Code.OTHER_SIZE, case="reduced", severity=Severity.CARE, figures=figures)]


def _find_otherwise(fit: CameraFit, every: Observations) -> list[Finding]:
    """Find them beside a fit, by all pairs in the target's units."""
    reference, nominal = fit.reference, fit.nominal
    errors = noise_by_photo(reference.pairs.image, fit.residual, len(reference.pairs.images))
    noise = local_noise_px(reference.pairs, fit.residual)
    if not reference.unfit and _HALF * errors.max() ** 2 < noise**2:
        return []
    if target := nominal.refined(fit.world):
        every = renamed(every, target, nominal.renamed).with_target(target)
    scaled = every.with_world(every.world / nominal.scale)
    # Photos that the fit left out have no pose yet.
    used = np.array([scaled.images.index(photo) for photo in reference.pairs.images])
    known = unplaced(len(scaled.images)).with_photos(used, reference.poses)
    saved, pairs, _ = fit_poses(reference.camera, scaled, known)
    if saved is None:
        return []
    before = None
    for _ in range(_ROUNDS):
        tried, square = _see_in_every_way(saved, pairs)
        way = np.where(square.min(axis=0) < _HALF * square[0], square.argmin(axis=0), 0)
        if not 0 < 2 * np.count_nonzero(way) < len(way):
            return []
        if before is not None and (way == before).all():
            break
        # Beside a radial lens all photos of a lopsided one are odd, and what is odd hides.
        right, poses = _put_right(pairs, way), Poses.chosen(tried, way)
        radial = refit_radial(reference, right, poses)
        whole = fit_cubic(radial, fit.prior, relative_decrease=ROUGH_DECREASE)
        lens, before = FixedLens(camera=whole.lens), way
        saved = adjust(lens, tried[0], pairs, wide_px(whole.errors), damping=WARM_DAMPING)
    least = square[way, np.arange(len(way))]
    by_noise = noise**2 * len(way)
    if least.sum() - by_noise > _HALF * (square[0].sum() - by_noise):
        return []
    odd = _find_odd(saved.lens, tried[0], whole, pairs)
    odd &= (way > 0) & (least < _AS_OTHERS * np.median(square[0, way == 0]))
    return _report(pairs.images, odd, square, reference.unfit)


def _see_in_every_way(
    saved: Adjustment[FixedLens], pairs: Observations
) -> tuple[list[Poses], FloatArray]:
    """Poses of photos put right in each way, and their squared errors (4, M)."""
    tried = [_see_mirrored(saved.poses, way) for way in range(len(_WAYS))]
    photos, square = np.arange(len(saved.poses)), np.zeros((len(_WAYS), len(saved.poses)))
    for decrease, damping in ((_ROUGHLY, COLD_DAMPING), (_EXACTLY, WARM_DAMPING)):
        own = select_photos(pairs, photos)
        for way, poses in enumerate(tried):
            seen = adjust(
                saved.lens,
                poses[photos],
                _put_right(own, np.full(len(photos), way)),
                wide_px(saved.errors),
                relative_decrease=decrease,
                damping=damping,
            )
            tried[way] = poses.with_photos(photos, seen.poses)
            square[way, photos] = noise_by_photo(own.image, seen.residual, len(photos)) ** 2
        if not (square.min(axis=0) < _HALF * square[0]).any():
            break
        photos = np.flatnonzero(square.min(axis=0) < square[0])
    return tried, square


def _find_odd(lens: FixedLens, poses: Poses, right: CameraFit, pairs: Observations) -> BoolArray:
    """Which photos (M,) have a lens of their own as they were saved, and none once put right.

    Args:
        lens: a lens beside which they are seen as they were saved, with ``poses``.
        poses: see ``lens``.
        right: the fit to all photos put right.
        pairs: the pairs as photos were saved.

    """
    as_saved = unlike(photo_lenses(lens, poses, pairs))
    own_lenses = lenses_of(right)
    split, put_right = best_split(own_lenses), unlike(own_lenses)
    odd = np.zeros(len(pairs.images), bool)
    if split is not None and split.chance < BY_CHANCE:  # something else explains more
        return odd
    for own, put in zip(as_saved, put_right, strict=True):
        odd[own.photo] = own.chance < BY_CHANCE < put.chance
    return odd


def _report(
    images: Sequence[str], odd: BoolArray, square: FloatArray, unfit: Collection[str]
) -> list[Finding]:
    """Report odd photos (M,) by their squared errors (4, M) under each way of saving."""
    # Where the centre is off along one side only, a turn by 180° does the same as a mirror.
    likely = _HALF * square < square.min(axis=0)
    turned, mirrored = likely[_TURNED], likely[1:_TURNED].any(axis=0)
    found = []
    for code, case, own in (
        (Code.TURNED, "", odd & ~mirrored),
        (Code.MIRRORED, "by_lens", odd & ~turned),
        (Code.MIRRORED, "or_turned", odd & turned & mirrored),
    ):
        if not own.any():
            continue
        names, rest = (tuple(np.array(images)[one].tolist()) for one in (own, ~own))
        after_px = float(np.sqrt(square.min(axis=0)[own].max()))
        found.append(
            Finding(
                code=code,
                case=case,
                # A camera that was made without them is right.
                severity=Severity.NOTE if {*names} <= {*unfit} else Severity.BAD,
                images=names,
                because="corrected",
                figures={"after_px": after_px, "where": "in", "rest": rest},
            )
        )
    return found


def _put_right(pairs: Observations, way: IntArray) -> Observations:
    """The pairs as they were before photos were saved in these ways (M,)."""
    signs = _WAYS[way[pairs.image]]
    last, world = np.array(pairs.image_size) - 1, pairs.world.copy()
    world[:, 0] *= signs.prod(axis=1)
    pixel = np.where(signs < 0, last - pairs.pixel, pairs.pixel)
    return replace(pairs.with_world(world), pixel=pixel)


def _see_mirrored(poses: Poses, way: int) -> Poses:
    """The poses of photos that are put right as if all were saved in one way."""
    mirror = np.append(_WAYS[way], 1)
    return Poses(
        rotation=mirror[:, None] * poses.rotation * [_WAYS[way].prod(), 1, 1],
        translation=mirror * poses.translation,
    )
