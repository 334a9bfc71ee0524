"""Two rigs of the same cameras: how far apart these stand, and how far apart their lenses are."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish.comparison import Comparison, compare
from cubicfish.errors import FitError
from cubicfish.geometry import camera_centre
from cubicfish.rigs.rig import Rig, RigCamera, sigmas_of
from cubicfish.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedCamera:
    """One camera of two rigs.

    Attributes:
        name: of the camera.
        lens: how far apart its lenses are; None where they do not see the same.
        turn_deg: by how much it is turned in the second rig beside the first.
        shift: (3,) how far it stands elsewhere, in the first rig's frame and units.
        turn_sigma_deg, shift_sigma: standard deviations of these, of both rigs together; None
            where either does not say, or for the first camera.
        sigmas: root of the mean square of the six differences over their standard deviations;
            None likewise.

    """

    name: str
    lens: Comparison
    turn_deg: float
    shift: FloatArray
    turn_sigma_deg: float | None
    shift_sigma: float | None
    sigmas: float | None

    def as_record(self) -> dict[str, Any]:
        """Plain data."""
        return {**vars(self), "shift": self.shift.tolist(), "lens": self.lens.as_record()}


def compare_rigs(first: Rig, second: Rig) -> list[ComparedCamera]:
    """How far apart two rigs are, beside the first camera that both have: places and lenses.

    A lens may turn its rays a little and its camera turn back: places are compared by where the
    rays of the same pixels go, so that this does not count.

    Args:
        first: one rig.
        second: another one, whose cameras have the same names.

    Raises:
        FitError: the rigs have fewer than two cameras in common, or other units.

    """
    if first.units != second.units:
        raise FitError(
            f"one rig's lengths are in {first.units} and the other's in {second.units}: calibrate "
            "both with targets of one unit"
        )
    others = {one.name: one for one in second.cameras}
    common = [(one, others[one.name]) for one in first.cameras if one.name in others]
    if len(common) < 2:
        raise FitError(
            f"the rigs have {len(common) or 'no'} camera{'s' * (len(common) != 1)} of one name "
            f"({', '.join(one.name for one in first.cameras)}; {', '.join(others)}): two are needed"
        )
    lenses = [compare(one.camera, other.camera) for one, other in common]
    # X in the frame of the second rig's camera -> in that of the first rig's.
    turns = [own.rotation.T for own in lenses]
    begin, begin_other = common[0]
    found = []
    for (one, other), lens, turn in zip(common, lenses, turns, strict=True):
        rotation, translation = one.beside(begin)
        theirs, shifted = other.beside(begin_other)
        theirs, shifted = turn @ theirs @ turns[0].T, turn @ shifted
        off = np.append(
            Rotation.from_matrix(theirs @ rotation.T).as_rotvec(), shifted - translation
        )
        covariance = None if one is begin else _sum_of(one, other, turn)
        sigma = (None, None) if covariance is None else sigmas_of(covariance)
        found.append(
            ComparedCamera(
                name=one.name,
                lens=lens,
                turn_deg=float(np.rad2deg(np.linalg.norm(off[:3]))),
                shift=begin.rotation.T
                @ (camera_centre(theirs, shifted) - camera_centre(rotation, translation)),
                turn_sigma_deg=sigma[0],
                shift_sigma=sigma[1],
                sigmas=None
                if covariance is None
                else float(np.sqrt(np.mean(np.square(off) / np.diagonal(covariance)))),
            )
        )
    return found


def _sum_of(one: RigCamera, other: RigCamera, turn: FloatArray) -> FloatArray | None:
    if one.covariance is None or other.covariance is None:
        return None
    both = np.kron(np.eye(2), turn)
    total = one.covariance + both @ other.covariance @ both.T
    return total if (np.diagonal(total) > 0).all() else None
