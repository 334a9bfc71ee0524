"""Photos of several cameras as the views of one body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.calibration import observed
from cubicfish.find.identification.identified import Detection
from cubicfish.fit.evaluate import Evaluation
from cubicfish.rigs.alone import Alone
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.shots import Matching, Shots, Times, match_shots
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.poses import Poses, rotation_from_vector
from cubicfish.solve.subset import select
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import IntArray


def observed_shots(
    cameras: Mapping[str, Observations | Detection],
    target: Target | None,
    shots: Matching,
    tolerance: float | None,
    times: Times | None,
) -> tuple[dict[str, Observations], Target | None, Shots]:
    """What each camera saw, checked, and which of their photos are of one shot.

    The arguments are those of :func:`calibrate_rig`.

    Returns:
        Corners or pairs by camera, the target that all are of, which the first may bring, and the
        shots.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: no two cameras share a shot.

    """
    seen: dict[str, Observations] = {}
    for name, own in cameras.items():
        seen[name] = observed(own, target)
        if len(seen) == 1:
            target = seen[name].target
    photos = {name: own.images for name, own in seen.items()}
    return seen, target, match_shots(photos, shots, tolerance, times)


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedViews:
    """All cameras' photos as the views of one rig, sorted by camera.

    Attributes:
        lens: lenses and places, and which view is whose.
        poses: camera_from_world of each view, as its camera found it alone.
        pairs: of all views.
        photos: of each view, its camera's photo.
        shots: of each shot, its name.

    """

    lens: RigLens
    poses: Poses
    pairs: Observations
    photos: tuple[str, ...]
    shots: tuple[str, ...]

    @classmethod
    def of_cameras(
        cls,
        lenses: Sequence[FitLens],
        alone: Sequence[Alone | Evaluation],
        shots: Shots,
        places: Poses | None = None,
    ) -> JoinedViews:
        """The views of cameras that are placed alone, in one world.

        Args:
            lenses: of each camera.
            alone: each camera's pairs and poses.
            shots: which photos are of one shot.
            places: camera_from_rig of each camera, where they are known and held; else all are in
                one place.

        """
        parts, views = [], []
        camera: list[int] = []
        shot: list[int] = []
        for number, (one, of_shot) in enumerate(zip(alone, shots.photos, strict=True)):
            listed = np.array([name in of_shot for name in one.pairs.images])
            own, kept = select(one.pairs, listed[one.pairs.image])
            parts.append(own)
            camera += [number] * len(kept)
            shot += [of_shot[name] for name in own.images]
            views.append(one.poses[kept])
        used, index = np.unique(shot, return_inverse=True)
        nowhere = np.zeros((len(lenses), 3))
        size = np.max([part.image_size for part in parts], axis=0).tolist()
        return cls(
            lens=RigLens(
                lenses=tuple(lenses),
                places=places or Poses(rotation=rotation_from_vector(nowhere), translation=nowhere),
                camera=np.array(camera, np.intp),
                shot=index.astype(np.intp),
                places_fixed=places is not None,
            ),
            poses=Poses.joined(views),
            pairs=replace(Observations.joined(parts), image_size=tuple(size)),
            photos=tuple(name for part in parts for name in part.images),
            shots=tuple(shots.names[number] for number in used),
        )

    def set_apart(self, shots: Poses, apart: IntArray) -> tuple[JoinedViews, Poses]:
        """Views that do not go with their shots get shots of their own: they say nothing of places.

        Args:
            shots: rig_from_world of each shot.
            apart: (A,) which views.

        Returns:
            The same of the new shots, and rig_from_world of these.

        """
        lens, shot = self.lens, self.lens.shot.copy()
        shot[apart] = len(shots) + np.arange(len(apart))
        own = lens.places[lens.camera[apart]].inverse() @ self.poses[apart]
        new = (f"{self.shots[lens.shot[view]]} ({self.photos[view]})" for view in apart)
        names = (*self.shots, *new)
        # A shot may be left without any view.
        used, shot = np.unique(shot, return_inverse=True)
        lens = replace(lens, shot=shot.astype(np.intp))
        named = tuple(names[number] for number in used)
        return replace(self, lens=lens, shots=named), Poses.joined([shots, own])[used]
