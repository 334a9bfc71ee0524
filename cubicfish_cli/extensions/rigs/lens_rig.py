"""A rig's cameras as another tool's lenses, with their places: what formats write."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish import Rig, ViewError, build_view, rectify
from cubicfish.rigs import RigCamera
from cubicfish_cli.commands.exporting import Exported
from cubicfish_cli.foreign.file_contents import FlatPair, LensRig, PlacedLens


def lens_rig(rig: Rig, converted: Sequence[tuple[RigCamera, Exported]]) -> LensRig:
    """The rig of some of its cameras' lenses: what other tools' files hold.

    Args:
        rig: the rig.
        converted: those of its cameras that are wanted, as lenses.

    """
    cameras = [camera for camera, _ in converted]
    return LensRig(
        lenses=tuple(_place_lens(camera, lens) for camera, lens in converted),
        units=rig.units,
        overlaps=np.array([[a is not b and a.overlaps(b) for b in cameras] for a in cameras]),
        flat=_make_flat(rig, converted) if len(converted) == 2 else None,
    )


def _place_lens(camera: RigCamera, lens: Exported) -> PlacedLens:
    turn = lens.conversion.lens_from_camera
    return replace(
        lens,
        name=camera.name,
        rotation=turn @ camera.rotation,
        translation=turn @ camera.translation,
    )


def _make_flat(rig: Rig, converted: Sequence[tuple[RigCamera, Exported]]) -> FlatPair | None:
    """Flat pictures of a pair; None where the cameras have no direction in common ahead."""
    try:
        pair = rectify(rig, *(camera.name for camera, _ in converted))
        view = build_view(pair)
    except ViewError:
        return None
    turns = [
        rotation @ lens.conversion.lens_from_camera.T
        for rotation, (_, lens) in zip(pair.rotations, converted, strict=True)
    ]
    return FlatPair(
        size=view.size,
        rotations=(turns[0], turns[1]),
        projections=pair.projections(view),
        Q=pair.Q(view),
    )
