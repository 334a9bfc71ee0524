"""P by linear least squares, when the rays are known (Zhu & Yin 2010, Eq. 8–9).

u·P3Φ − P1Φ = 0 and v·P3Φ − P2Φ = 0 weight each pair by its unknown denominator P3Φ, which
biases the plain solution. Dividing by the previous round's denominator (Sanathanan & Koerner
1963) removes that.
"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.core.lenses.lift import lift, sphere_basis
from cubicfish_cli.core.types import FloatArray

ROUNDS = 10
# Rounds end when no denominator changes by more than this share of their mean.
_SETTLED = 1e-6
# A pair beside a pole must not get an unbounded weight in the next round.
_SMALLEST_SHARE = 0.02


def linear_coefficients(
    rays: FloatArray,
    pixel: FloatArray,
    *,
    denominator_pull: float,
    rounds: int = ROUNDS,
    weights: FloatArray | None = None,
) -> FloatArray:
    """C (3, 16) with P = C Bᵀ, in the units of ``pixel``; the mean of P3Φ over the rays is 1.

    Solved in the 16-dimensional row space of Φ on the sphere: with all 20 columns the smallest
    singular vector would be one of the cubics that vanish on the sphere. Rays that a smooth lens
    made leave the solution nearly free even then (numerator and denominator may share a factor),
    with poles wherever rounding puts them; a small pull of P3Φ towards 1 picks the tame one.

    Args:
        rays: (N, 3) unit rays.
        pixel: (N, 2), best normalised to order 1 (Hartley).
        denominator_pull: weight of P3Φ = 1 at each ray; 0 is the homogeneous system of the paper.
        rounds: reweighting rounds, at most; 0 is the paper's plain solution.
        weights: (N,) of each ray's two equations; 1 by default.

    """
    values = lift(rays) @ sphere_basis()
    return linear_ratios(
        values, pixel, denominator_pull=denominator_pull, rounds=rounds, weights=weights
    )


def linear_ratios(
    values: FloatArray,
    pixel: FloatArray,
    *,
    denominator_pull: float,
    rounds: int = ROUNDS,
    weights: FloatArray | None = None,
) -> FloatArray:
    """C (3, K) whose ratios of rows C · values are the pixels; see :func:`linear_coefficients`.

    Args:
        values: (N, K) Φ of each point in a basis of its row space.
        pixel: (N, 2), best normalised to order 1 (Hartley).
        denominator_pull: weight of C3 · values = 1 at each point.
        rounds: reweighting rounds, at most.
        weights: (N,) of each point's two equations; 1 by default.

    """
    denominator = np.ones(len(values))
    weight = denominator if weights is None else weights
    coefficients = np.zeros((3, values.shape[1]))
    for _ in range(rounds + 1):
        rows = values * (weight / denominator)[:, None]
        zeros = np.zeros_like(rows)
        system = np.vstack(
            [
                np.hstack([-rows, zeros, pixel[:, :1] * rows]),
                np.hstack([zeros, -rows, pixel[:, 1:] * rows]),
            ]
        )
        if denominator_pull > 0:
            pull = denominator_pull * np.hstack([zeros, zeros, values])
            wanted = np.concatenate([np.zeros(len(system)), np.full(len(pull), denominator_pull)])
            solution = np.linalg.lstsq(np.vstack([system, pull]), wanted, rcond=None)[0]
        else:
            # The triangular factor has the same right singular vectors and is small.
            solution = np.linalg.svd(np.linalg.qr(system, mode="r"))[2][-1]
        coefficients = solution.reshape(3, -1)
        found = values @ coefficients[2]
        scale = found.mean()
        coefficients, found = coefficients / scale, found / scale
        found = np.maximum(found, _SMALLEST_SHARE)
        settled = np.abs(found - denominator).max() < _SETTLED
        denominator = found
        if settled:
            break
    return coefficients
