"""Fields found from what the camera sees: nothing empty, nothing lost, and no more than that."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from asymmetric_lens import AsymmetricLens
from lenses import cubic_camera
from synthetic import TRUE_LENS

from cubicfish import Calibration, ViewError, build_map, build_view
from cubicfish.models.sphere import cone_rays
from cubicfish.views import CentralView
from cubicfish.views.fields import (
    _sample_region,
    _shows,
    axis_focal,
    fit_view,
    seen_field_deg,
    sees,
)
from cubicfish.views.view import PROJECTIONS, rotation_from_angles

SIZE = (120, 90)


def kept_share(camera: AsymmetricLens, view: CentralView) -> float:
    """Share of the solid angle that the camera sees which is in the view."""
    return float(_shows(view, region(camera)).mean())


region = cache(_sample_region)


@cache
def lens(field_deg: float) -> AsymmetricLens:
    """A decentred lens whose circle of this field fills most of the photo's height."""
    half = field_deg / 2
    focal = 0.46 * 360 / np.radians(half)
    return replace(
        TRUE_LENS,
        image_size=(480, 360),
        fx=focal,
        fy=1.01 * focal,
        cx=244.0,
        cy=176.0,
        k=(-0.01, 0.0, 0.0, 0.0),
        max_angle_deg=half,
    )


@cache  # the same for all views of a camera
def regions_rays(camera) -> np.ndarray:
    angle = np.radians(camera.max_angle_deg)
    turn = np.linspace(0, 2 * np.pi, 3000)
    rim = [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), 0 * turn + np.cos(angle)]
    rays = np.vstack([cone_rays(angle, 5000), np.stack(rim, axis=-1) + np.array([0, 0, 1e-9])])
    return rays[sees(camera, rays)]


def lost(camera, view: CentralView) -> int:
    """How many of many rays that the camera sees are not in the view, by 1/50 of its pixels."""
    pixel = view.pixels(regions_rays(camera))
    limit = np.array(view.size) - 0.48
    return int((~((pixel >= -0.52) & (pixel <= limit)).all(axis=-1)).sum())


def fitted(camera, kind, share, rotation=(0.0, 0.0, 0.0), size=SIZE) -> tuple[CentralView, bool]:
    return fit_view(camera, CentralView(kind=kind, size=size, focal=1.0, rotation=rotation), share)


def narrower(view: CentralView, by: float) -> CentralView:
    return replace(view, focal=view.focal * by)


FIELDS = [60, *(pytest.param(deg, marks=pytest.mark.slow) for deg in (140, 180)), 220]


@pytest.mark.parametrize("kind", list(PROJECTIONS))
@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("angles", [{}, {"yaw_deg": 12, "pitch_deg": -7, "roll_deg": 40}])
def test_inner_has_no_empty_pixel_and_could_not_be_wider(kind, field, angles):
    camera = lens(field)
    view, at_limit = fitted(camera, kind, 0.0, rotation_from_angles(**angles))
    assert build_map(camera, view).valid.all()
    if at_limit:
        assert field >= 180
    else:
        assert not build_map(camera, narrower(view, 0.99)).valid.all()


@pytest.mark.parametrize("kind", list(PROJECTIONS))
@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("angles", [{}, {"yaw_deg": 12, "pitch_deg": -7, "roll_deg": 40}])
def test_outer_loses_nothing_and_could_not_be_narrower(kind, field, angles):
    camera = lens(field)
    view, at_limit = fitted(camera, kind, 1.0, rotation_from_angles(**angles))
    if at_limit:
        # Only these have directions that no picture of theirs can reach.
        assert kind in ("perspective", "cylindrical", "epipolar-cylindrical")
        assert lost(camera, view) > 0
        assert max(view.hfov_deg, view.vfov_deg) == pytest.approx(160, abs=1e-3) or (
            kind != "perspective"
        )
    else:
        assert lost(camera, view) == 0
        assert kept_share(camera, view) == 1
        assert lost(camera, narrower(view, 1.02)) > 0


@pytest.mark.parametrize("kind", list(PROJECTIONS))
def test_a_view_that_looks_aside_loses_nothing_either(kind):
    camera = lens(220)
    for angles in ({"yaw_deg": 90}, {"pitch_deg": 90}, {"yaw_deg": 180}):
        view, at_limit = fitted(camera, kind, 1.0, rotation_from_angles(**angles))
        assert at_limit or lost(camera, view) == 0
        if kind in ("equirectangular", "equidistant"):
            assert not at_limit


def test_shares_run_from_inner_to_outer():
    camera = cubic_camera(85.0)
    views = [fitted(camera, "equidistant", s)[0] for s in (0.0, 0.25, 0.5, 0.75, 1.0)]
    fields = [view.hfov_deg for view in views]
    assert fields == sorted(fields)
    kept = [kept_share(camera, view) for view in views]
    empty = [1 - build_map(camera, view).valid.mean() for view in views]
    assert kept == sorted(kept)
    assert empty == sorted(empty)
    assert empty[0] == 0
    assert kept[-1] == 1
    assert views[2].focal == pytest.approx(np.sqrt(views[0].focal * views[4].focal))


def test_a_view_whose_middle_is_unseen_has_no_inner_fit():
    rotation = rotation_from_angles(yaw_deg=150)
    with pytest.raises(ViewError, match="does not see the middle"):
        fitted(lens(180), "perspective", 0.0, rotation)


def test_the_photos_corners_count_where_the_circle_is_cut():
    # A wide lens on a small sensor: the photo's frame, not the cone, ends what is seen.
    camera = replace(lens(180), fx=300.0, fy=300.0)
    view, _ = fitted(camera, "equidistant", 1.0, size=(480, 360))
    assert view.hfov_deg < 120
    assert lost(camera, view) == 0
    inner, _ = fitted(camera, "perspective", 0.0, size=(480, 360))
    assert build_map(camera, inner).valid.all()
    assert not build_map(camera, narrower(inner, 0.99)).valid.all()


@pytest.mark.parametrize("yaw", [0, 40, 180])
@pytest.mark.parametrize("kind", sorted(PROJECTIONS))
def test_the_seen_field_is_what_rays_say(kind, yaw):
    camera = cubic_camera(100.0)
    rotation = rotation_from_angles(yaw_deg=yaw)
    view = CentralView.with_field(kind, 150, (700, 500), rotation)
    if PROJECTIONS[kind].widest[0][
        1
    ]:  # the camera is beyond both ends of a full turn, and nothing between
        view = replace(view, focal=700 / (2 * np.pi))
    step = 0.01
    angle = np.arange(-view.hfov_deg / 2, view.hfov_deg / 2, step)
    across = np.radians(angle + yaw)
    rays = np.stack([np.sin(across), 0 * across, np.cos(across)], axis=-1)
    down = np.radians(np.arange(-view.vfov_deg / 2, view.vfov_deg / 2, step))
    upright = np.stack([0 * down, np.sin(down), np.cos(down)], axis=-1)
    upright = upright @ view.camera_from_view.T
    expected = [sees(camera, way).sum() * step for way in (rays, upright)]
    a_pixel = 1.5 * np.degrees(1 / view.focal)
    assert seen_field_deg(camera, view) == pytest.approx(expected, abs=a_pixel)
    if yaw == 40 and kind == "perspective":
        assert 0.5 < expected[0] / view.hfov_deg < 0.9


def test_longitude_and_latitude_are_as_large_as_what_is_seen(fitted: Calibration) -> None:
    camera = fitted.camera
    view = build_view(camera, "equirectangular")
    assert view.focal == pytest.approx(axis_focal(camera))
    assert kept_share(camera, view) > 0.97
    # Both poles are seen, and so is something on all sides of them: all round would be half empty.
    assert camera.max_angle_deg > 95
    a_pixel = np.degrees(1 / view.focal)
    assert seen_field_deg(camera, view)[0] == pytest.approx(view.hfov_deg, abs=4 * a_pixel)
    aside = build_view(camera, "epipolar-equirectangular")
    assert seen_field_deg(camera, aside)[1] == pytest.approx(aside.vfov_deg, abs=4)
    narrow = build_view(lens(150.0), "equirectangular")
    assert kept_share(lens(150.0), narrow) == 1
    assert view.size[0] % 2 == view.size[1] % 2 == 0
    up = build_view(camera, "equirectangular", rotate_deg=(0, 90, 0))
    assert kept_share(camera, up) > 0.999  # a pole is at the edge
    assert up.hfov_deg == pytest.approx(360, abs=0.5)
    assert build_view(camera, "equirectangular", size=(400, 200)).size == (400, 200)


@pytest.mark.parametrize("kind", ["cylindrical", "epipolar-cylindrical"])
def test_a_cylinder_ends_where_nothing_more_is_seen(kind):
    camera = cubic_camera(95.0)
    view = build_view(camera, kind)
    side = int(kind != "cylindrical")
    seen = build_map(camera, view).valid.any(axis=side)
    assert seen[[0, -1]].any()
    whole = build_view(camera, kind, size=camera.image_size)
    assert view.size[side] < whole.size[side] == camera.image_size[side]
    assert whole.focal == view.focal
    assert build_map(camera, view).valid.sum() == build_map(camera, whole).valid.sum()
