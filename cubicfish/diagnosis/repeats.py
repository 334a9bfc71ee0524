"""Photos from one place, which say no more than one of them."""

import numpy as np

from cubicfish.fit.calibration import FitEvidence
from cubicfish.fit.folds import NEAR_SHARE, repeated_groups
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding

_FEWEST_PHOTOS = 3


def repeats(evidence: FitEvidence) -> list[Finding]:
    """Find photos that are from the same place, or all from nearly the same."""
    fit = evidence.fit
    pairs, poses = fit.reference.pairs, fit.poses
    focal = fit.reference.camera.fx
    count = len(pairs.images)
    if count < 2:
        return []
    group = repeated_groups(poses, pairs, focal)
    distinct = int(group.max()) + 1
    if count >= _FEWEST_PHOTOS and repeated_groups(poses, pairs, focal, NEAR_SHARE).max() == 0:
        figures = {"photos": count, "near": NEAR_SHARE}
        return [Finding(code=Code.ONE_PLACE, severity=Severity.CARE, figures=figures)]
    if distinct == count:
        return []
    same = [
        [pairs.images[np.flatnonzero(group == group[photo])[0]], pairs.images[photo]]
        for photo in range(count)
        if np.flatnonzero(group == group[photo])[0] != photo
    ]
    few = 2 * distinct <= count or distinct < _FEWEST_PHOTOS
    return [
        Finding(
            code=Code.REPEATS,
            severity=Severity.CARE if few else Severity.NOTE,
            figures={"photos": count, "distinct": distinct, "repeats": same},
            images=tuple(np.array(pairs.images)[np.bincount(group)[group] > 1].tolist()),
        )
    ]
