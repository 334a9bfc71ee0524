"""Where estimates that many photos or shots make, each for itself, fall into two groups."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray


def best_cut(
    orders: IntArray, weight: FloatArray, pull: FloatArray, fewest: int
) -> tuple[float, float, BoolArray] | None:
    """The split with the largest ratio of what is between to what is within its groups.

    Args:
        orders: (S, K) what is split, in orders that are cut in two anywhere.
        weight: (K, n, n) information of each on what it has of its own, and ``pull`` (K, n) that
            times it.
        pull: see ``weight``.
        fewest: how many a group has at least.

    Returns:
        The ratio, what is between, and which are behind the cut; None where there are too few.

    """
    count = len(pull)
    square = np.einsum("ki,ki->k", pull, np.linalg.solve(weight, pull[:, :, None])[:, :, 0])
    mean = np.linalg.solve(weight.sum(axis=0), pull.sum(axis=0))
    total = float(square.sum() - mean @ pull.sum(axis=0))
    # Of those up to each cut, and of those behind it: sums suffice for their scatter.
    cuts = np.arange(fewest, count - fewest + 1)
    best: tuple[float, float, BoolArray] | None = None
    for order in orders if cuts.size else []:
        before = [np.cumsum(terms[order], axis=0) for terms in (weight, pull, square)]
        within = np.zeros(len(cuts))
        for w, p, s in (
            [terms[cuts - 1] for terms in before],
            [terms[-1] - terms[cuts - 1] for terms in before],
        ):
            means = np.linalg.solve(w, p[:, :, None])[:, :, 0]
            within += np.maximum(s - np.sum(means * p, axis=1), 0)
        within = np.maximum(within, max(1e-12 * total, 1e-300))
        cut = int(np.argmin(within))
        between = float(total - within[cut])
        ratio = between / float(within[cut]) * (count - 2)
        if best is None or ratio > best[0]:
            second = np.zeros(count, bool)
            second[order[cuts[cut] :]] = True
            best = (ratio, between, second)
    return best
