"""Photos that were saved mirrored, turned by 180° or reduced, as the lens's centre shows.

A board looks like itself in a mirror, or upside down, and its corners are named by what is seen.
But no lens's centre is in the middle of the picture: it jumps to the other side of it, and with it
whatever else is lopsided about the lens.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from cubicfish.diagnosis.photo_lenses import BY_CHANCE, photo_lenses, unlike
from cubicfish.diagnosis.two_lenses import best_split
from cubicfish.fit.calibration import FitEvidence
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.radial_reference import refit_radial
from cubicfish.fit.start import fit_poses, unplaced
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.adjustment import WARM_DAMPING, adjust
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
# photos that some other way suits better are fitted on.
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
    pairs, camera = every.with_world(every.world / nominal.scale), reference.camera
    # Photos that the fit left out have no pose yet.
    used = [pairs.images.index(photo) for photo in reference.pairs.images]
    known = unplaced(len(pairs.images)).with_photos(np.array(used), reference.poses)
    start, pairs, placed = fit_poses(camera, pairs, known)
    if start is None:
        return []
    way, limit = np.zeros(len(placed), np.intp), wide_px(start.errors)
    tried = [_see_mirrored(start.poses, one) for one in range(len(_WAYS))]
    damping = COLD_DAMPING
    for _ in range(_ROUNDS):
        before, square = way, np.zeros((len(_WAYS), len(way)))
        photos = np.arange(len(way))
        for decrease in (_ROUGHLY, _EXACTLY):
            own, lens = select_photos(pairs, photos), FixedLens(camera=camera)
            for one, poses in enumerate(tried):
                right = _put_right(own, np.full(len(photos), one))
                seen = adjust(
                    lens,
                    poses[photos],
                    right,
                    limit,
                    relative_decrease=decrease,
                    damping=damping,
                )
                if one == 0 and decrease == _ROUGHLY:  # all photos, as they were saved
                    limit = wide_px(seen.errors)
                tried[one] = poses.with_photos(photos, seen.poses)
                square[one, photos] = noise_by_photo(own.image, seen.residual, len(photos)) ** 2
            photos, damping = np.flatnonzero(square.min(axis=0) < square[0]), WARM_DAMPING
            way = np.where(square.min(axis=0) < _HALF * square[0], square.argmin(axis=0), 0)
            if not way.any():
                break
        if 2 * np.count_nonzero(way) >= len(way):
            return []
        chosen, right = Poses.chosen(tried, way), _put_right(pairs, way)
        if (way == before).all():
            break
        camera = refit_radial(reference, right, chosen).camera
    least = square[way, np.arange(len(way))]
    by_noise = noise**2 * len(way)
    if least.sum() - by_noise > _HALF * (square[0].sum() - by_noise):
        return []
    odd = _find_odd(lens, pairs, tried[0], right, chosen)
    odd &= (way > 0) & (least < _AS_OTHERS * np.median(square[0, way == 0]))
    return _report(pairs.images, odd, square, reference.unfit)


def _find_odd(
    lens: FixedLens, saved: Observations, poses: Poses, right: Observations, chosen: Poses
) -> BoolArray:
    """Which photos (M,) have a lens of their own as they were saved, and none once put right.

    Args:
        lens: the lens.
        saved: the pairs as the photos were saved; ``poses`` are theirs.
        poses: see ``saved``.
        right: the pairs once put right; ``chosen`` are their poses.
        chosen: see ``right``.

    """
    as_saved = unlike(photo_lenses(lens, poses, saved))
    own_lenses = photo_lenses(lens, chosen, right)
    split, put_right = best_split(own_lenses), unlike(own_lenses)
    odd = np.zeros(len(saved.images), bool)
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
