"""A rig as other tools' lenses, and where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.errors import ViewError
from cubicfish_cli.fitting.conversion.to_lens import Conversion
from cubicfish_cli.fitting.statistics import poses_on_record
from cubicfish_cli.formats.lens_rig import FlatPair, LensRig, PlacedLens
from cubicfish_cli.formats.rig_yaml import RigFile, RigFileCamera
from cubicfish_cli.lenses.sphere import cone_rays
from cubicfish_cli.library.rig_pictures import rectify
from cubicfish_cli.rendering.pose import rotation_matrix
from cubicfish_cli.undistortion.fit import sees
from cubicfish_cli.undistortion.views import default_view

_OVERLAP_RAYS = 2000


@dataclass(frozen=True, kw_only=True, eq=False)
class ConvertedCamera:
    """A camera of a rig as another tool's lens: the lens, and what is told of it."""

    camera: RigFileCamera
    conversion: Conversion
    note: Sequence[str]


def lens_rig(rig: RigFile, converted: Sequence[ConvertedCamera]) -> LensRig:
    """The rig of some of its cameras' lenses: what other tools' files hold.

    Args:
        rig: the rig.
        converted: those of its cameras that are wanted.

    """
    cameras = [one.camera for one in converted]
    return LensRig(
        lenses=tuple(map(_placed, converted)),
        units=rig.units,
        overlaps=np.array([[a is not b and _overlap(a, b) for b in cameras] for a in cameras]),
        flat=_flat(rig, converted) if len(converted) == 2 else None,
    )


def _placed(one: ConvertedCamera) -> PlacedLens:
    turn, camera = one.conversion.lens_from_camera, one.camera
    return PlacedLens(
        name=camera.name,
        lens=one.conversion.lens,
        note=one.note,
        rotation=turn @ camera.rotation,
        translation=turn @ camera.translation,
        max_angle_deg=camera.camera.max_angle_deg,
        poses={
            name: (turn @ rotation_matrix(vector), turn @ np.asarray(translation))
            for name, (vector, translation) in poses_on_record(camera.file.fit).items()
        },
    )


def _overlap(first: RigFileCamera, second: RigFileCamera) -> bool:
    """Whether two cameras see some far thing both."""
    rays = cone_rays(np.deg2rad(first.camera.max_angle_deg), _OVERLAP_RAYS)
    own = rays[sees(first.camera, rays)]
    return bool(sees(second.camera, own @ first.rotation @ second.rotation.T).any())


def _flat(rig: RigFile, converted: Sequence[ConvertedCamera]) -> FlatPair | None:
    """Flat pictures of a pair; None where the cameras have no direction in common ahead."""
    first, second = converted
    try:
        pair = rectify(rig, first.camera.name, second.camera.name)
        view = default_view(pair)
    except ViewError:
        return None
    turns = [
        rotation @ one.conversion.lens_from_camera.T
        for rotation, one in zip(pair.rotations, converted, strict=True)
    ]
    return FlatPair(
        size=view.size,
        rotations=(turns[0], turns[1]),
        projections=pair.projections(view),
        Q=pair.Q(view),
    )
