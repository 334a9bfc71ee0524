"""What is likely wrong with a rig's shots: a camera that moved, photos of other shots, too few."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from cubicfish.diagnosis.photo_lenses import best_cut
from cubicfish.fit.folds import MIN_PHOTOS, NEAR_SHARE, SAME_SHARE, repeated_groups
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.rigs.joint_fit import RigProblem
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.times import Clocks, Timing, clocks_of
from cubicfish.rigs.views import JoinedViews
from cubicfish.solve.adjustment import Adjustment, linearise
from cubicfish.solve.statistics import noise_px
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# Two cameras that fewer shots connect stand where one shot's errors put them.
_FEW = 5
# Shots on either side of where a camera may have moved; fewer say nothing of the usual one.
_LEAST_SHOTS = 3
_RCOND = 1e-10
# A camera has moved where so little chance would show as much,
_CHANCE = 1e-5
# and what it does to its corners is as large as so much of their noise.
_VISIBLE = 0.5
# Shots are not of one moment where the usual one is off by more of its corners' noise; one shot
# stands out that is off by more of it, and by so many times more than the usual one.
_OFF, _APART, _STANDS_OUT = 1.5, 2.0, 6.0
# Less than that, in pixels, is not worth words, however quiet the corners are.
_LEAST_PX = 0.25
# Of more of the shots than these, it is no longer single ones that stand out.
_SINGLE = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """A camera that stood elsewhere from some shot on.

    Attributes:
        camera: which.
        shot: name of the first shot after it moved.
        step: (6,) turn in the camera's frame, radians, and shift.
        effect_px: RMS of what that does to the camera's corners.
        chance: of as much by chance, over all cameras and shots.
        share: of what shots have against the camera's one place, what two places explain.
        apart: (A,) its views on the side with fewer shots.
        before: whether that is the side before it moved.

    """

    camera: int
    shot: str
    step: FloatArray
    effect_px: float
    chance: float
    share: float
    apart: IntArray
    before: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class RigEvidence:
    """A fitted rig.

    Attributes:
        problem: what was fitted.
        views: its views, by which photos and shots are named.
        fit: of the rig.
        timing: how its photos' times were fitted; None where they are not.
        moved: cameras that were found to have moved, as far as that was taken out.

    """

    problem: RigProblem
    views: JoinedViews
    fit: Adjustment[RigLens]
    timing: Timing | None
    moved: Sequence[Moved] = ()

    @property
    def names(self) -> Sequence[str]:
        """The cameras' names."""
        return self.problem.names

    @cached_property
    def pairs(self) -> Observations:
        """Its pairs, all of one weight, with the world points that were fitted."""
        return self.problem.pairs.with_world(self.fit.world.points)

    @property
    def lens(self) -> RigLens:
        """The lenses and places of the rig."""
        return self.fit.lens

    @property
    def shots(self) -> tuple[str, ...]:
        """The shots' names, in the order in which they were taken."""
        return self.views.shots

    @cached_property
    def places(self) -> IntArray:
        """(S,) numbers from 0: shots that show the target from the same place have one."""
        return self._group_shots(SAME_SHARE)

    @cached_property
    def is_one_place(self) -> bool:
        """Whether all shots show it from nearly the same place."""
        return len(self.shots) >= MIN_PHOTOS and self._group_shots(NEAR_SHARE).max() == 0

    def _group_shots(self, share: float) -> IntArray:
        focal = self.problem.singly[0].camera.radial.fx
        named = replace(self.pairs, certain=np.ones(len(self.pairs.image), bool))
        return repeated_groups(self.fit.poses, named, focal, share)

    @cached_property
    def clocks(self) -> Clocks | None:
        """By how much cameras were late, which was taken out; None where it is not known."""
        return None if self.timing is None else clocks_of(self.fit, self.timing)

    @cached_property
    def of_views(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """Of each view's shot's pose: Hessian (V, 6, 6), gradient (V, 6), and (V,) its corners."""
        fit, pairs, views = self.fit, self.pairs, len(self.lens.shot)
        hessian, gradient = np.zeros((views, 6, 6)), np.zeros((views, 6))
        for run, terms in linearise(fit, pairs, fit.huber_px):
            across = terms.by_pose.transpose(0, 2, 1)
            np.add.at(hessian, pairs.image[run], across @ terms.by_pose)
            np.add.at(gradient, pairs.image[run], (across @ terms.miss[:, :, None])[:, :, 0])
        return hessian, gradient, np.bincount(pairs.image, minlength=views)


def moved_camera(evidence: RigEvidence) -> Moved | None:
    """The camera that most clearly stood elsewhere before some shot than after; None if none did.

    What each shot says of each camera's place beside the others', its pose left free, is linear
    where the fit stopped. Two means, before and after, are judged against how shots differ
    among themselves (an F test), which knows of all errors that shots do not share.
    """
    cameras = range(len(evidence.lens.lenses))
    moved = [one for camera in cameras if (one := _split(evidence, camera))]
    best = min(moved, key=lambda one: (one.chance, -one.effect_px), default=None)
    if best is None or best.chance * len(cameras) > _CHANCE:
        return None
    return best if best.effect_px > _VISIBLE * noise_px(evidence.fit.residual) else None


def says(evidence: RigEvidence, camera: int) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """What shots say of one camera's place beside the others', their poses left free.

    Returns:
        Shots (S,) that others saw too, in order; Hessian (S, 6, 6), gradient (S, 6) by a step in
        the camera's frame, and how many corners the camera saw.

    """
    lens, (hessian, gradient, corners) = evidence.lens, evidence.of_views
    shots = int(lens.shot.max()) + 1
    hessian_of, gradient_of = np.zeros((shots, 6, 6)), np.zeros((shots, 6))
    np.add.at(hessian_of, lens.shot, hessian)
    np.add.at(gradient_of, lens.shot, gradient)
    several = np.bincount(lens.shot)[lens.shot] > 1
    views = np.flatnonzero((lens.camera == camera) & several)
    views = views[np.argsort(lens.shot[views], kind="stable")]
    shot = lens.shot[views]
    own, pull = hessian[views], gradient[views]
    # Less what the shot's pose would make up for.
    share = own @ np.linalg.pinv(hessian_of[shot], hermitian=True)
    turned = np.kron(np.eye(2), lens.places.rotation[camera])
    left = turned @ (own - share @ own) @ turned.T
    pulled = (pull - (share @ gradient_of[shot][:, :, None])[:, :, 0]) @ turned.T
    return shot, left, pulled, corners[views]


def _split(evidence: RigEvidence, camera: int) -> Moved | None:
    """The shot from which on the camera stands elsewhere, if it does anywhere."""
    shots, hessian, gradient, corners = says(evidence, camera)
    pull, floor = -gradient, _RCOND * np.trace(hessian, axis1=1, axis2=2)
    weight = hessian + floor[:, None, None] * np.eye(6)
    found = best_cut(np.arange(len(shots))[None], weight, pull, _LEAST_SHOTS)
    if found is None:
        return None
    ratio, between, after = found
    sides = [(hessian[side].sum(axis=0), pull[side].sum(axis=0)) for side in (~after, after)]
    means = [np.linalg.lstsq(h, p, rcond=_RCOND)[0] for h, p in sides]
    cuts, freedom = len(shots) - 2 * _LEAST_SHOTS + 1, len(shots) - 2
    # Where both sides are alike, the later one is how the rig is now.
    before = 2 * int(after.sum()) >= len(shots)
    apart = np.isin(evidence.lens.shot, shots[~after if before else after])
    return Moved(
        camera=camera,
        shot=evidence.shots[shots[int(np.argmax(after))]],
        step=means[1] - means[0],
        effect_px=float(np.sqrt(between / corners.sum())),
        chance=float(fdtrc(6, 6 * freedom, ratio)) * cuts,
        share=ratio / (ratio + freedom),
        apart=np.flatnonzero((evidence.lens.camera == camera) & apart),
        before=before,
    )


def explained(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """(S,) the squared error that a step of its own takes away in each shot."""
    both = zip(hessian, gradient, strict=True)
    return np.array([g @ np.linalg.lstsq(h, g, rcond=_RCOND)[0] for h, g in both])


def camera_moved(evidence: RigEvidence) -> list[Finding]:
    """That cameras stood elsewhere before some shot than after."""
    names = evidence.names
    return [
        Finding(
            code=Code.CAMERA_MOVED,
            severity=Severity.BAD,
            case="" if len(names) > 2 else "either",
            cameras=(names[moved.camera],) if len(names) > 2 else tuple(names),
            shots=(moved.shot,),
            figures={
                "turn_deg": float(np.rad2deg(np.linalg.norm(moved.step[:3]))),
                "shift": float(np.linalg.norm(moved.step[3:])) * evidence.problem.common.scale,
                "units": evidence.problem.units or "of the target's units",
                "effect_px": moved.effect_px,
                "photos": len(moved.apart),
                "part": ("before" if moved.before else "after") if len(moved.apart) else "none",
            },
        )
        for moved in evidence.moved
    ]


def not_at_once(evidence: RigEvidence) -> list[Finding]:
    """Shots of which a camera's photo does not go with the others', and it did not move for good.

    All shots where cameras are not triggered at once and something moves; single ones where
    something was knocked, or a photo is of a neighbouring shot.
    """
    names, shots, lens = evidence.names, evidence.shots, evidence.lens
    noise = noise_px(evidence.fit.residual)
    off = np.zeros((len(lens.lenses), len(shots)))
    for camera in range(len(lens.lenses)):
        shot, hessian, gradient, corners = says(evidence, camera)
        # Six unknowns take so much of the noise, whatever is wrong.
        more = np.maximum(explained(hessian, gradient) - 6 * noise**2, 0) / np.maximum(corners, 1)
        off[camera, shot] = np.sqrt(more)
    shared = np.bincount(lens.shot, minlength=len(shots)) > 1
    if int(shared.sum()) < _LEAST_SHOTS:
        return []
    worst = off.max(axis=0)
    usual = float(np.median(worst[shared]))
    if evidence.clocks is None and usual > max(_OFF * noise, _LEAST_PX):
        whom = int(np.argmax(np.sum(np.square(off), axis=1) / np.maximum((off > 0).sum(axis=1), 1)))
        return [_report_off(Code.NOT_AT_ONCE, names, (whom,), (), usual)]
    limit = max(_APART * noise, _STANDS_OUT * usual, _LEAST_PX)
    out = np.flatnonzero(shared & (worst > limit))
    if len(out) > max(1.0, _SINGLE * shared.sum()):
        return []
    found: list[Finding] = []
    for shot in out[np.argsort(-worst[out])].tolist():
        seen_by = lens.camera[lens.shot == shot].tolist()
        apart = tuple(seen_by) if len(seen_by) < 3 else (int(np.argmax(off[:, shot])),)
        found.append(_report_off(Code.SHOT_APART, names, apart, (shots[shot],), worst[shot]))
    return found


def _report_off(
    code: Code, names: Sequence[str], whom: tuple[int, ...], shots: tuple[str, ...], off_px: float
) -> Finding:
    both = len(names) == 2
    cameras = tuple(names) if both else tuple(names[one] for one in whom)
    return Finding(
        code=code,
        severity=Severity.BAD if code == Code.NOT_AT_ONCE else Severity.CARE,
        case="either" if len(cameras) > 1 else "",
        cameras=cameras,
        shots=shots,
        figures={"off_px": float(off_px)},
    )


def clocks_differ(evidence: RigEvidence) -> list[Finding]:
    """Cameras whose clocks are not the first one's, which was taken out."""
    names, clocks = evidence.names, evidence.clocks
    if clocks is None:
        return []
    return [
        Finding(
            code=Code.CLOCKS_DIFFER,
            severity=Severity.NOTE,
            case="ahead" if clocks.late[camera] < 0 else "",
            cameras=(names[camera], names[0]),
            figures={
                "late_ms": 1e3 * abs(float(clocks.late[camera])),
                "sigma_ms": 1e3 * float(clocks.sigma[camera]),
                "effect_px": float(clocks.effect_px[camera]),
            },
        )
        for camera in np.flatnonzero(clocks.late).tolist()
    ]


def free_running(evidence: RigEvidence) -> list[Finding]:
    """Cameras that take the photos of a shot at moments of their own: each photo has its time."""
    clocks = evidence.clocks
    if clocks is None:
        return []
    limit = max(noise_px(evidence.fit.residual), _LEAST_PX)
    cameras = np.flatnonzero(clocks.scatter_px > limit).tolist()
    if not cameras:
        return []
    return [
        Finding(
            code=Code.NOT_AT_ONCE,
            severity=Severity.CARE,
            case="fitted",
            cameras=tuple(evidence.names[camera] for camera in cameras),
            figures={"off_px": float(clocks.scatter_px.max())},
        )
    ]


def mismatched(evidence: RigEvidence) -> list[Finding]:
    """Photos that are not of their shot."""
    names, start, lens = evidence.names, evidence.problem.start, evidence.lens
    return [
        Finding(
            code=Code.SHOT_MISMATCHED,
            severity=Severity.BAD,
            cameras=(names[lens.camera[view]],),
            shots=(evidence.views.photos[view],),
            figures={"off_px": float(start.misfit[view])},
        )
        for view in np.flatnonzero(start.apart).tolist()
    ]


def few_common_shots(evidence: RigEvidence) -> list[Finding]:
    """Cameras whose strongest connection to the others is weak."""
    common = evidence.lens.common_shots.copy()
    np.fill_diagonal(common, -1)
    weak: dict[frozenset[int], tuple[int, int]] = {}
    for camera, other in enumerate(common.argmax(axis=1).tolist()):
        if common[camera, other] < _FEW:
            weak.setdefault(frozenset({camera, other}), (camera, other))
    return [
        Finding(
            code=Code.FEW_COMMON_SHOTS,
            severity=Severity.CARE,
            cameras=tuple(evidence.names[one] for one in both),
            figures={"shots": float(common[both]), "wanted": float(_FEW - common[both])},
        )
        for both in weak.values()
    ]


def repeated_shots(evidence: RigEvidence) -> list[Finding]:
    """Shots that show the target from the same place, as those of one moment do."""
    shots, places = evidence.shots, evidence.places
    if evidence.is_one_place:
        figures = {"shots": len(shots), "near": NEAR_SHARE}
        return [Finding(code=Code.ONE_PLACE, case="shots", severity=Severity.CARE, figures=figures)]
    _, first = np.unique(places, return_index=True)
    lens = evidence.lens
    seen_by = np.zeros((len(lens.lenses), len(shots)), bool)
    seen_by[lens.camera, lens.shot] = True
    # What two cameras see apart may be one moment; a camera that sees it twice learns nothing new.
    twice = (seen_by & seen_by[:, first[places]]).any(axis=0)
    again = np.flatnonzero(twice & (first[places] != np.arange(len(shots))))
    if not len(again):
        return []
    before = first[places[again]]
    distinct = len(shots) - len(again)
    few = 2 * distinct <= len(shots) or distinct < MIN_PHOTOS
    pairs = zip(before.tolist(), again.tolist(), strict=True)
    return [
        Finding(
            code=Code.REPEATS,
            case="shots",
            severity=Severity.CARE if few else Severity.NOTE,
            shots=tuple(np.array(shots)[np.union1d(before, again)].tolist()),
            figures={
                "shots": len(shots),
                "distinct": distinct,
                "repeats": [[shots[one], shots[other]] for one, other in pairs],
            },
        )
    ]


def find_rig_faults(evidence: RigEvidence) -> list[Finding]:
    """What is likely wrong with a rig, in the order in which it is reported: first each camera."""
    moved, repeats = camera_moved(evidence), repeated_shots(evidence)
    said = {one.code for one in repeats}  # not again of each camera
    return [
        *(
            finding
            for one in evidence.problem.singly
            for finding in one.findings
            if finding.code not in said
        ),
        *mismatched(evidence),
        *free_running(evidence),
        *clocks_differ(evidence),
        *moved,
        *([] if moved else not_at_once(evidence)),
        *few_common_shots(evidence),
        *repeats,
    ]
