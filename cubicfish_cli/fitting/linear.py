"""P by linear least squares, when the rays are known (Zhu & Yin 2010, Eq. 8–9).

u·P3Φ − P1Φ = 0 and v·P3Φ − P2Φ = 0 weight each pair by its unknown denominator P3Φ, which
biases the plain solution. Dividing by the previous round's denominator (Sanathanan & Koerner
1963) removes that.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.model.lift import lift, sphere_basis

FloatArray = npt.NDArray[np.float64]

ROUNDS = 10


def linear_coefficients(
    rays: FloatArray, pixel: FloatArray, weight: FloatArray, *, rounds: int = ROUNDS
) -> FloatArray:
    """C (3, 16) with P = C Bᵀ, in the units of ``pixel``, mean P3Φ over the rays positive.

    Solved in the 16-dimensional row space of Φ on the sphere: with all 20 columns the smallest
    singular vector would be one of the cubics that vanish on the sphere.

    Args:
        rays: (N, 3) unit rays.
        pixel: (N, 2), best normalised to order 1 (Hartley).
        weight: (N,) weight of each pair.
        rounds: reweighting rounds; 0 is the paper's plain solution.

    """
    values = lift(rays) @ sphere_basis()
    denominator = np.ones(len(values))
    coefficients = np.zeros((3, 16))
    for _ in range(rounds + 1):
        rows = values * (weight / denominator)[:, None]
        zeros = np.zeros_like(rows)
        system = np.vstack(
            [
                np.hstack([-rows, zeros, pixel[:, :1] * rows]),
                np.hstack([zeros, -rows, pixel[:, 1:] * rows]),
            ]
        )
        # The triangular factor has the same right singular vectors and is 48x48.
        triangle = np.linalg.qr(system, mode="r")
        coefficients = np.linalg.svd(triangle)[2][-1].reshape(3, 16)
        found = values @ coefficients[2]
        if np.median(found) < 0:
            coefficients, found = -coefficients, -found
        # A pair beside a pole must not get an unbounded weight in the next round.
        denominator = np.maximum(found, 0.02 * np.median(np.abs(found)))
    return coefficients
