"""A rig's photos as pictures: the body that is asked for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from cubicfish_cli.errors import ViewError
from cubicfish_cli.fitting.rig.calibrate import PlacedCamera, RigCalibration
from cubicfish_cli.formats.rig_yaml import RigFile, RigFileCamera
from cubicfish_cli.photos import Picture
from cubicfish_cli.undistortion.choose import build_view
from cubicfish_cli.undistortion.rigs import (
    Body,
    BodyCamera,
    RectifiedPair,
    mosaic_of,
    rectified_pair,
)
from cubicfish_cli.undistortion.view import View
from cubicfish_cli.wording import did_you_mean, quoted


def rectify(rig: RigFile | RigCalibration, first: str, second: str) -> RectifiedPair:
    """Two cameras of a rig, turned so that their pictures have common rows.

    It is a camera that sees what both see: :func:`build_view` takes it, for flat views and the
    epipolar kinds, ``views`` gives either camera's own view for :func:`build_map`, and ``points``
    what disparities are worth.

    Args:
        rig: the rig.
        first: name of a camera.
        second: name of another.

    Raises:
        ViewError: there is no such camera, or the two stand at one place.

    """
    one, other = _named(rig, first), _named(rig, second)
    turn = other.rotation @ one.rotation.T
    shift = other.translation - turn @ one.translation
    return rectified_pair(one.camera, other.camera, turn, shift)


def stitch(
    rig: RigFile | RigCalibration,
    photos: Mapping[str, Picture],
    view: View | None = None,
    *,
    distance: float | None = None,
) -> Picture:
    """One picture of a shot, as ``undistort`` renders it.

    Args:
        rig: the rig.
        photos: by the camera's name, (H, W[, C]) of one depth; a camera without one takes no part.
        view: what to show, in the frame of the rig; by default all around, as longitude and
            latitude at the photos' scale.
        distance: how far from the middle of the cameras things are that join, in the rig's unit;
            None for far away.

    Returns:
        (h, w[, C]) of the same depth, black where no camera sees anything.

    Raises:
        ViewError: there is no such camera, a photo has another size than its camera's, photos
            differ in depth or channels, or no camera sees anything of the view.

    """
    for name in photos:
        _named(rig, name)
    body = replace(body_of_rig(rig), distance=distance)
    chosen = build_view(body, "equirectangular") if view is None else view
    return mosaic_of(body, chosen).render(dict(photos))[0]


def _named(rig: RigFile | RigCalibration, name: str) -> RigFileCamera | PlacedCamera:
    there = {one.name: one for one in rig.cameras}
    if name not in there:
        raise ViewError(f"the rig has no camera {quoted(name)}: {did_you_mean(name, list(there))}")
    return there[name]


def body_of_rig(rig: RigFile | RigCalibration) -> Body:
    """A rig as one camera that sees what any of its cameras sees."""
    return Body(
        cameras=tuple(
            BodyCamera(
                name=one.name,
                camera=one.camera,
                rotation=one.rotation,
                translation=one.translation,
            )
            for one in rig.cameras
        )
    )
