"""A rig's photos as pictures: the body that is asked for them, and faces of cubes for splats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.errors import ViewError
from cubicfish_cli.fitting.rig.calibrate import PlacedCamera, RigCalibration
from cubicfish_cli.formats.camera_format import LensRig, PlacedLens, Pose
from cubicfish_cli.formats.colmap_cameras import colmap_rig_text
from cubicfish_cli.formats.nerfstudio_json import nerfstudio_rig_text
from cubicfish_cli.formats.rig_yaml import RigFile, RigFileCamera
from cubicfish_cli.lenses.pinhole import PinholeLens
from cubicfish_cli.photos import Picture
from cubicfish_cli.rendering.truth import rotation_matrix
from cubicfish_cli.undistortion.choose import build_view
from cubicfish_cli.undistortion.maps import UndistortMap, build_map
from cubicfish_cli.undistortion.projections import PerspectiveView
from cubicfish_cli.undistortion.rigs import (
    Body,
    BodyCamera,
    RectifiedPair,
    mosaic_of,
    rectified_pair,
)
from cubicfish_cli.undistortion.view import View
from cubicfish_cli.wording import did_you_mean, quoted

# A face of which the camera sees less than this share is not worth a file.
_LEAST_SEEN = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class Face:
    """A flat picture out of one camera's photos.

    Attributes:
        name: the camera's and the face's.
        camera: the camera.
        view: what it shows, in the camera's frame.
        map: that makes it.

    """

    name: str
    camera: BodyCamera
    view: PerspectiveView
    map: UndistortMap


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
    """One picture of a shot, as ``undistort --rig`` renders it.

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


def faces_of(body: Body, views: Mapping[str, Mapping[str, View]]) -> tuple[Face, ...]:
    """The flat pictures about each camera of which it sees something.

    Args:
        body: the cameras.
        views: for each camera by its name, name of the face -> view in its frame.

    """
    faces = []
    for one in body.cameras:
        for name, view in views[one.name].items():
            made = build_map(one.camera, view)
            if isinstance(view, PerspectiveView) and made.valid.mean() > _LEAST_SEEN:
                faces.append(Face(name=f"{one.name}_{name}", camera=one, view=view, map=made))
    return tuple(faces)


def faces_texts(rig: RigFile, faces: Sequence[Face], photos: Mapping[str, str]) -> dict[str, str]:
    """Where faces were taken from, for COLMAP and, where it is known, for nerfstudio.

    Shots that took part in the calibration have their place in the target's frame; one shot alone
    stands in the rig's.

    Args:
        rig: the rig.
        faces: of its cameras.
        photos: shot -> name of its pictures' files.

    Returns:
        Name of a file -> its text.

    """
    shots: dict[str, Pose] = {}
    for record in rig.fit.get("per_shot", []):
        pose = record["rig_from_world"]
        vector, shift = np.array(pose["rotation_vector"], float), pose["translation"]
        shots[str(record["shot"])] = rotation_matrix(vector), np.array(shift, float)
    if len(photos) == 1:
        shots = {**dict.fromkeys(photos, (np.eye(3), np.zeros(3))), **shots}
    lenses = []
    for face in faces:
        turn = face.view.camera_from_view.T
        rotation, translation = turn @ face.camera.rotation, turn @ face.camera.translation
        x, y = face.view.middle
        lenses.append(
            PlacedLens(
                name=face.name,
                lens=PinholeLens(
                    image_size=face.view.size,
                    fx=face.view.focal,
                    fy=face.view.focal,
                    cx=x,
                    cy=y,
                    d=np.zeros(0),
                ),
                note=[],
                rotation=rotation,
                translation=translation,
                max_angle_deg=90.0,
                poses={
                    name: (
                        rotation @ shots[shot][0],
                        rotation @ shots[shot][1] + translation,
                    )
                    for shot, name in photos.items()
                    if shot in shots
                },
            )
        )
    made = LensRig(
        lenses=tuple(lenses), units=rig.units, overlaps=np.zeros((len(lenses),) * 2, bool)
    )
    texts = {"rig_config.json": colmap_rig_text(made)}
    if any(one.poses for one in lenses):
        texts["transforms.json"] = nerfstudio_rig_text(made, images="images", masks="masks")
    return texts
