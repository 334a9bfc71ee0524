"""Every kind of view: its rays by hand, there and back, its fields, and the fast way to its map."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import cubic_camera
from saved_maps import every_pixel

from cubicfish import CubicCamera, UsageError, build_map
from cubicfish.views import CentralView, ViewOptions
from cubicfish.views.view import FACES, PROJECTIONS, PlaneView, face_views, rotation_from_angles

S = math.sqrt(0.5)
TURNED = rotation_from_angles(yaw_deg=50, pitch_deg=-20, roll_deg=70)
CAMERA = cubic_camera(110.0)


def unit(rays):
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


# Ray of the view, and where it lies in focal lengths from the middle.
@pytest.mark.parametrize(
    ("kind", "ray", "offset"),
    [
        ("perspective", (1, -2, 4), (0.25, -0.5)),
        ("cylindrical", (S, 1, S), (math.pi / 4, 1)),
        ("cylindrical", (0, -2, -1), (math.pi, -2)),
        ("equirectangular", (1, 0, 0), (math.pi / 2, 0)),
        ("equirectangular", (0, S, S), (0, math.pi / 4)),
        ("stereographic", (1, 0, 0), (2, 0)),
        ("stereographic", (0, S, -S), (0, 2 * math.tan(math.pi * 3 / 8))),
        ("equidistant", (0, 1, 0), (0, math.pi / 2)),
        ("equidistant", (-S, 0, -S), (-math.pi * 3 / 4, 0)),
    ],
)
def test_directions_lie_where_the_formula_says(kind, ray, offset):
    view = CentralView(kind=kind, size=(201, 101), focal=10.0)
    pixel = np.array([100, 50]) + 10 * np.array(offset)
    np.testing.assert_allclose(view.pixels(ray), pixel, atol=1e-9)
    np.testing.assert_allclose(unit(view.rays(pixel)), unit(np.array(ray, float)), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(PROJECTIONS))
@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.tuples(*[st.floats(-3, 3)] * 3))
def test_rays_and_pixels_are_inverse(kind, x, y, rotation):
    view = CentralView(kind=kind, size=(64, 48), focal=20.0, rotation=rotation)
    pixel = np.array([31.5, 23.5]) + 20 * np.array([x, y])
    np.testing.assert_allclose(view.pixels(5 * view.rays(pixel)), pixel, atol=1e-6)


@pytest.mark.parametrize("kind", list(PROJECTIONS))
@pytest.mark.parametrize("field", [30, 90, 150])
@pytest.mark.parametrize("vertical", [False, True])
def test_a_field_is_from_edge_to_edge(kind, field, vertical):
    view = CentralView.with_field(kind, field, (64, 48), vertical=vertical)
    edges = [[31.5, -0.5], [31.5, 47.5]] if vertical else [[-0.5, 23.5], [63.5, 23.5]]
    one, other = unit(view.rays(edges))
    assert math.degrees(math.acos(one @ other)) == pytest.approx(field)
    assert (view.vfov_deg if vertical else view.hfov_deg) == pytest.approx(field)


@pytest.mark.parametrize(
    ("kind", "field", "vertical"),
    [
        ("perspective", 180, False),
        ("cylindrical", 361, False),
        ("cylindrical", 180, True),
        ("equirectangular", 181, True),
        ("stereographic", 360, False),
        ("equidistant", 361, False),
    ],
)
def test_a_field_that_the_kind_cannot_have_is_refused(kind, field, vertical):
    with pytest.raises(UsageError, match=rf"too wide: an? {kind} view shows"):
        ViewOptions(kind=kind, **{"vfov_deg" if vertical else "hfov_deg": field})


@pytest.mark.parametrize(
    ("view", "pixel"),
    [
        (CentralView(kind="cylindrical", size=(64, 48), focal=9.0), (60.5, 24)),
        (CentralView(kind="equirectangular", size=(64, 48), focal=10.0), (31.5, 40)),
        (CentralView(kind="equidistant", size=(64, 48), focal=9.0), (4.0, 0.0)),
    ],
)
def test_what_lies_beyond_the_whole_turn_is_empty_and_not_read_twice(view, pixel):
    assert np.isnan(view.rays(pixel)).any()
    x, y = (round(side) for side in pixel)
    made = build_map(replace_cone(179.0), view)
    assert not made.valid[y, x]
    assert made.map_x[y, x] == -1


def replace_cone(angle: float) -> CubicCamera:
    return replace(CAMERA, max_angle_deg=angle)


def test_nothing_behind_is_shown():
    for kind in ("perspective", "stereographic"):
        assert np.isnan(CentralView(kind=kind, size=(64, 48), focal=9.0).pixels([0.0, 0, -1])).all()
    assert np.isnan(
        CentralView(kind="perspective", size=(64, 48), focal=9.0).pixels([1.0, 0, -1])
    ).all()


def views():
    for kind in PROJECTIONS:
        for field in (40, 110, 170, 220, 300, 359.9):
            if field < PROJECTIONS[kind].widest[0][0]:
                for rotation in ((0.0, 0.0, 0.0), TURNED):
                    view = partial(CentralView.with_field, kind, field, (101, 75), rotation)
                    yield pytest.param(view, id=f"{kind}-{field}-{rotation != (0, 0, 0)}")
    axes = np.array(rotation_matrix(TURNED))
    for origin in ((-20.0, -15.0, 60.0), (5.0, -50.0, 25.0)):
        yield pytest.param(
            partial(
                PlaneView,
                size=(101, 75),
                origin=origin,
                x_axis=(1.0, 0.0, 0.0),
                y_axis=(0.0, 1.0, 0.0),
                pixels_per_unit=1.1,
            ),
            id="plane",
        )
    yield pytest.param(
        partial(
            PlaneView,
            size=(101, 75),
            origin=tuple((axes @ [-40.0, -30.0, 50.0]).tolist()),
            x_axis=tuple(axes[:, 0].tolist()),
            y_axis=tuple(axes[:, 1].tolist()),
            pixels_per_unit=0.9,
        ),
        id="plane-turned",
    )


def rotation_matrix(rotation):
    return CentralView(
        kind="perspective", size=(1, 1), focal=1.0, rotation=rotation
    ).camera_from_view


@pytest.mark.parametrize("make", list(views()))
def test_the_fast_map_is_the_plain_one(make):
    view = make()
    made = build_map(CAMERA, view)
    pixel = CAMERA.project(view.rays(every_pixel(view)))
    limit = np.array(CAMERA.image_size) - 1
    with np.errstate(invalid="ignore"):
        inside = ((pixel >= 0) & (pixel <= limit)).all(axis=-1)
    # A pixel on the very edge of the cone or the photo may fall to either side by rounding.
    assert (inside != made.valid).sum() <= 2
    both = inside & made.valid
    got = np.stack([made.map_x, made.map_y], axis=-1)
    # What float32 can hold of coordinates up to 1,024, and no more.
    assert np.abs(got - pixel)[both].max(initial=0) <= 2**-14
    assert (got[~made.valid] == -1).all()
    assert both.any() or 1 - both.mean() > 0.99


@pytest.mark.parametrize("make", list(views()))
def test_a_record_has_all_that_the_view_is_made_of(make):
    view = make()
    record = json.loads(json.dumps(view.as_record()))
    assert (record.pop("kind"), record.pop("size")) == (view.kind, list(view.size))
    own = {key: tuple(one) if isinstance(one, list) else one for key, one in record.items()}
    assert type(view)(kind=view.kind, size=view.size, **own) == view


@pytest.mark.parametrize("kind", list(PROJECTIONS))
def test_no_kind_is_evaluated_ray_by_ray(monkeypatch, kind):
    def slow(*_):
        raise AssertionError("projected ray by ray")

    monkeypatch.setattr(CubicCamera, "project", slow)
    assert build_map(CAMERA, CentralView.with_field(kind, 60, (40, 30))).valid.all()


def test_options_name_every_kind_that_there_is():
    assert (*PROJECTIONS, "cube") == ViewOptions.KINDS


def test_the_faces_of_a_cube_meet_at_their_edges():
    faces = face_views(8)
    assert list(faces) == list(FACES)
    corners = {
        name: face.rays([[-0.5, -0.5], [7.5, -0.5], [-0.5, 7.5], [7.5, 7.5]])
        for name, face in faces.items()
    }
    for a, edge_a, b, edge_b in [
        ("front", (1, 3), "right", (0, 2)),
        ("right", (1, 3), "back", (0, 2)),
        ("left", (1, 3), "front", (0, 2)),
        ("up", (2, 3), "front", (0, 1)),
        ("front", (2, 3), "down", (0, 1)),
    ]:
        np.testing.assert_allclose(corners[a][list(edge_a)], corners[b][list(edge_b)], atol=1e-12)


def test_a_turned_cube_turns_all_its_faces():
    turned = face_views(8, TURNED)
    for name, face in face_views(8).items():
        matrix = rotation_matrix(TURNED) @ face.camera_from_view
        np.testing.assert_allclose(turned[name].camera_from_view, matrix, atol=1e-12)


PLANE = {
    "size": (4, 3),
    "origin": (0.0, 0.0, 5.0),
    "x_axis": (1.0, 0.0, 0.0),
    "y_axis": (0.0, 1.0, 0.0),
    "pixels_per_unit": 2.0,
}


def test_a_planes_pixels_are_its_points():
    view = PlaneView(**PLANE)
    np.testing.assert_allclose(view.rays([[0, 0], [2, 4]]), [[0, 0, 5], [1, 2, 5]])
    np.testing.assert_allclose(view.pixels([[1, 2, 5], [2, 4, 10]]), [[2, 4], [2, 4]])
    assert np.isnan(view.pixels([0.0, 0, -5])).all()
