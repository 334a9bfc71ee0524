"""Where the cameras of a rig stand, from the poses that each found alone. No guess is needed.

Two cameras that see the target in one shot say how they stand to each other, whether they see the
same of it or not. The strongest of these pairs connect all cameras; then every shot is placed by
the camera with which the others agree best.

Photos that were taken with another camera of the rig than they are said to be are refused.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from cubicfish.errors import FitError
from cubicfish.fit.evaluate import evaluate
from cubicfish.io.camera_yaml import Calibrated
from cubicfish.models.cubic import CubicCamera
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.views import JoinedViews
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import noise_px
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray
from cubicfish.wording import listed

# Photos fit another lens so many times better before they are said to be its.
_TIMES = 2.0
_SEEDS = 40
_ROUNDS = 30
# A view whose corners are off by more than both under the pose of its shot is of another shot.
_GROSS_TIMES = 10.0
_GROSS_SHARE = 0.01
# Cameras of which the typical shot is off by more of the photo's longer side stand nowhere.
_LOST_SHARE = 0.03
# So many of the worst shots are named.
_WORST = 3


def refuse_the_same(cameras: Mapping[str, Observations]) -> None:
    """Refuse cameras with the same photos: no two see corners at the same places to the last digit.

    Args:
        cameras: by name, their pairs.

    Raises:
        FitError: most corners of two are the same; the text names them.

    """
    places = {name: {*map(tuple, own.pixel.tolist())} for name, own in cameras.items()}
    for one, other in combinations(cameras, 2):
        fewer = min(len(places[one]), len(places[other]))
        if 2 * len(places[one] & places[other]) > fewer:
            raise FitError(
                f"cameras {one} and {other} have the same photos: their corners are at the same "
                "pixels",
                do="give each camera its own photos",
            )


def refuse_exchanged(cameras: Mapping[str, Observations], known: Mapping[str, Calibrated]) -> None:
    """Refuse photos that are of another size than their lens, or fit another one far better.

    Args:
        cameras: by name, their pairs.
        known: by name, those that are calibrated already.

    Raises:
        FitError: they do; the text names the cameras.

    """
    for name, one in known.items():
        size = one.camera.image_size
        if size != cameras[name].image_size:
            raise FitError(
                "camera {}: its photos have {}x{} pixels and its lens is of {}x{}: check that no "
                "two cameras are swapped".format(name, *cameras[name].image_size, *size)
            )
    error = {
        (name, lens): _measure_misfit_px(known[lens].camera, pairs)
        for name, pairs in cameras.items()
        for lens in known
    }
    for lens in known:
        mine = error[lens, lens]
        for name in cameras:
            # Of a camera whose lens is not known it is enough that its photos fit this one.
            theirs, back = error.get((name, name), np.inf), error.get((lens, name), 0.0)
            if name != lens and mine > _TIMES * error[name, lens] and theirs > _TIMES * back:
                raise FitError(
                    f"cameras {lens} and {name} are swapped: the photos of {name} fit the lens "
                    f"of {lens} ({error[name, lens]:.2g} px where its own are off by {mine:.2g} "
                    "px): exchange their folders"
                )


def _measure_misfit_px(camera: CubicCamera, pairs: Observations) -> float:
    """Noise of the photos' corners under a lens, their poses fitted, pixels."""
    try:
        return noise_px(evaluate(camera, pairs).residual)
    except FitError:
        return np.inf


def _choose_some(count: int) -> IntArray:
    """Of so many places some, evenly: among them is one from which the others are to be sought."""
    return np.unique(np.linspace(0, count - 1, min(count, _SEEDS)).astype(np.intp))


def apart(poses: Poses, other: Poses) -> FloatArray:
    """(S,) how far poses are from another one (1,): radians, and lengths."""
    turn = Rotation.from_matrix(poses.rotation) * Rotation.from_matrix(other.rotation[0]).inv()
    shift = np.linalg.norm(poses.translation - other.translation, axis=1)
    return np.asarray(turn.magnitude() + shift)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigStart:
    """A first rig.

    Attributes:
        places: camera_from_rig of each camera, the first one's the identity.
        shots: rig_from_world of each shot; NaN where no camera sees it.
        misfit: (V,) median error of each view under its shot's pose, pixels.
        apart: (V,) views that do not go with the other views of their shot.

    """

    places: Poses
    shots: Poses
    misfit: FloatArray
    apart: BoolArray


def median_pose(poses: Poses) -> Poses:
    """One pose (1,) amid many, which a few that are wrong do not move.

    The turn is the one with the smallest sum of angles to all others (the geodesic L1 median,
    Hartley et al. 2011), the shift that with the smallest sum of distances.
    """
    turn = Rotation.from_matrix(poses.rotation)
    tried = turn[_choose_some(len(poses))]
    angles = [(turn * one.inv()).magnitude().sum() for one in tried]
    middle = tried[int(np.argmin(angles))]
    for _ in range(_ROUNDS):
        away = (turn * middle.inv()).as_rotvec()
        weight = 1 / np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        middle = Rotation.from_rotvec((weight @ away) / weight.sum()) * middle
    shift = np.median(poses.translation, axis=0)
    floor = 1e-9 * max(1e-300, float(np.abs(poses.translation).max()))
    for _ in range(_ROUNDS):
        away = poses.translation - shift
        weight = 1 / np.maximum(np.linalg.norm(away, axis=1), floor)
        shift = shift + (weight @ away) / weight.sum()
    return Poses(rotation=middle.as_matrix()[None], translation=shift[None])


def start_rig(names: Sequence[str], joined: JoinedViews) -> RigStart:
    """Place the cameras and the shots.

    Args:
        names: of the cameras, for words.
        joined: the views; the target's lengths are about 1. Cameras' places are not looked at.

    Raises:
        FitError: the cameras are not connected, or no one body has them.

    """
    lens, views, common = joined.lens, joined.poses, joined.lens.common_shots
    relative: dict[tuple[int, int], Poses] = {}
    for a, b in combinations(range(len(names)), 2):
        if common[a, b]:
            of_a, of_b = _find_together(lens, a, b)
            relative[a, b] = median_pose(views[of_b] @ views[of_a].inverse())
            relative[b, a] = relative[a, b].inverse()
    places, edges = _place_cameras(names, common, relative)
    joined = replace(joined, lens=replace(lens, places=places))
    size, typical = max(joined.pairs.image_size), 0.0
    for a, b in edges:
        of_a, of_b = _find_together(lens, a, b)
        rigs = places[lens.camera[of_a]].inverse() @ views[of_a]
        errors = _measure_view_errors(joined, rigs, of_b)
        error = float(np.median(errors))
        if error > _LOST_SHARE * size:
            worst = [
                f"{joined.photos[of_b[one]]} ({min(errors[one], size):.0f} px)"
                for one in np.argsort(-errors, kind="stable")[:_WORST].tolist()
            ]
            raise FitError(
                f"the shots of {names[a]} and {names[b]} do not fit one rig (they disagree by "
                f"{min(error, size):.0f} px in the median, most in {listed(worst)})",
                do="look at these, and check that photos of one shot were taken at the same moment "
                "and are matched rightly, and that no camera moved",
            )
        typical = max(typical, error)
    shots, misfit = place_shots(joined)
    several = np.bincount(lens.shot, minlength=len(shots))[lens.shot] > 1
    wrong = several & (misfit > np.maximum(_GROSS_TIMES * typical, _GROSS_SHARE * size))
    return RigStart(places=places, shots=shots, misfit=misfit, apart=wrong)


def connected(common: IntArray) -> bool:
    """Whether shots in common (C, C) lead from each camera to each other one."""
    return int(connected_components(common > 0, directed=False)[0]) == 1


def _find_together(lens: RigLens, a: int, b: int) -> tuple[IntArray, IntArray]:
    """Views of two cameras of the shots that both saw."""
    of_a, of_b = np.flatnonzero(lens.camera == a), np.flatnonzero(lens.camera == b)
    _, first, second = np.intersect1d(lens.shot[of_a], lens.shot[of_b], return_indices=True)
    return of_a[first], of_b[second]


def _place_cameras(
    names: Sequence[str], common: IntArray, relative: dict[tuple[int, int], Poses]
) -> tuple[Poses, list[tuple[int, int]]]:
    """camera_from_rig along the pairs with most shots in common, from the first camera on.

    And these pairs.
    """
    edges: list[tuple[int, int]] = []
    found = {0: Poses(rotation=np.eye(3)[None], translation=np.zeros((1, 3)))}
    while len(found) < len(names):
        shared = [(common[a, b], -a, -b) for a, b in relative if a in found and b not in found]
        if not shared:
            raise _explain_unconnected(names, found)
        _, a, b = max(shared)
        found[-b] = relative[-a, -b] @ found[-a]
        edges.append((-a, -b))
    return Poses.joined([found[camera] for camera in range(len(names))]), edges


def _explain_unconnected(names: Sequence[str], found: dict[int, Poses]) -> FitError:
    near = " and ".join(names[camera] for camera in sorted(found))
    far = [name for camera, name in enumerate(names) if camera not in found]
    return FitError(
        f"no shot shows the target to {far[0]} and to {near} at once, so nothing connects them",
        do=f"take five or more shots in which {far[0]} and one of the others each see a board of "
        "the target (not necessarily the same board), or check that shots are matched rightly",
    )


def place_shots(joined: JoinedViews) -> tuple[Poses, FloatArray]:
    """rig_from_world of each shot, by the view with which the shot's others agree best.

    And how far each view (V,) is off then, pixels.
    """
    lens, views, pairs = joined.lens, joined.poses, joined.pairs
    proposed = lens.places[lens.camera].inverse() @ views
    count, cameras = int(lens.shot.max()) + 1, len(lens.lenses)
    view_of = np.full((cameras, count), -1, np.intp)
    view_of[lens.camera, lens.shot] = np.arange(len(views))
    best, proposer = np.full(count, np.inf), np.full(count, -1, np.intp)
    misfit = np.zeros(len(views))
    for camera in range(cameras):
        by = view_of[camera, lens.shot]
        judged = np.flatnonzero(by >= 0)
        errors = _measure_view_errors(joined, proposed[by[judged]], judged)
        # A capped sum: one view that is of another shot must not choose.
        capped = np.minimum(errors, _LOST_SHARE * max(pairs.image_size))
        total = np.bincount(lens.shot[judged], capped, count)
        better = (view_of[camera] >= 0) & (total < best)
        best[better], proposer[better] = total[better], view_of[camera, better]
        own = better[lens.shot[judged]]
        misfit[judged[own]] = errors[own]
    seen = np.flatnonzero(proposer >= 0)
    nowhere = Poses(
        rotation=np.full((count, 3, 3), np.nan), translation=np.full((count, 3), np.nan)
    )
    return nowhere.with_photos(seen, proposed[proposer[seen]]), misfit


def _measure_view_errors(joined: JoinedViews, rigs: Poses, views: IntArray) -> FloatArray:
    """Median error (V,) of each of some views' corners under its pose of the rig, pixels.

    Args:
        joined: all views, with the places of the cameras.
        rigs: rig_from_world, one for each of these views.
        views: increasing.

    """
    lens, pairs = joined.lens, joined.pairs
    poses = lens.places[lens.camera[views]] @ rigs
    bounds = np.searchsorted(pairs.image, [views, views + 1])
    rows = np.concatenate([np.arange(*own) for own in bounds.T]) if len(views) else views
    each = np.repeat(np.arange(len(views)), bounds[1] - bounds[0])
    points = poses.apply(each, pairs.world[rows])
    length = np.empty(len(rows))
    with np.errstate(all="ignore"):
        for camera in np.unique(lens.camera[views]).tolist():
            own = lens.camera[views][each] == camera
            miss = lens.lenses[camera].project(points[own]) - pairs.pixel[rows[own]]
            length[own] = np.hypot(miss[:, 0], miss[:, 1])
    length[~np.isfinite(length)] = np.inf
    starts = np.cumsum(bounds[1] - bounds[0])[:-1]
    return np.array([np.median(one) for one in np.split(length, starts)])
