from dataclasses import replace

import cv2
import numpy as np
import pytest
from synthetic import TRUE_LENS, lens_of_size

from cubicfish import CubicCamera, ViewError, build_map, build_view
from cubicfish.models import RadialCamera
from cubicfish.models.lift import lift
from cubicfish.views import CentralView, maps
from cubicfish.views.view import rotation_from_angles

LENS = lens_of_size(0.25)
SIZE = LENS.image_size


def cubic_camera(max_angle_deg=93.0):
    """A cubic camera with all 60 entries at work, by weighted least squares from a lens."""
    rng = np.random.default_rng(1)
    z = rng.uniform(np.cos(np.radians(96)), 1, 4000)
    turn = rng.uniform(-np.pi, np.pi, 4000)
    rays = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1)
    rays = rays[~np.isnan(LENS.project(rays)).any(axis=1)]
    phi, weight = lift(rays), np.ones(len(rays))
    pixel = (LENS.project(rays) - [LENS.cx, LENS.cy]) / 100
    for _ in range(5):
        rows = [np.hstack([phi, 0 * phi, -pixel[:, :1] * phi])]
        rows += [np.hstack([0 * phi, phi, -pixel[:, 1:] * phi])]
        system = np.vstack(rows) * np.tile(weight, 2)[:, None]
        # Each row of P is fixed but for four directions: the solution is the 13th vector.
        vector = np.linalg.eigh(system.T @ system)[1]
        P = vector[:, 12].reshape(3, 20)
        weight = 1 / np.abs(phi @ P[2])
    # Give every entry something to do; the camera stays sound.
    P = P + 1e-3 * np.linalg.norm(P, axis=1, keepdims=True) * rng.standard_normal((3, 20))
    P = np.array([[100, 0, LENS.cx], [0, 100, LENS.cy], [0, 0, 1]]) @ P
    reference = RadialCamera(image_size=SIZE, fx=65, fy=65, cx=120, cy=90, k=np.zeros(4))
    return CubicCamera(image_size=SIZE, P=P, max_angle_deg=max_angle_deg, radial=reference)


def truth(camera, view):
    """The map by its definition, pixel by pixel: (h, w, 2), NaN where it is not valid."""
    x, y = np.meshgrid(np.arange(view.size[0]), np.arange(view.size[1]))
    pixel = camera.project(view.rays(np.stack([x, y], axis=-1)))
    limit = np.array(camera.image_size) - 1
    with np.errstate(invalid="ignore"):
        inside = ((pixel >= 0) & (pixel <= limit)).all(axis=-1)
    return np.where(inside[..., None], pixel, np.nan)


def check_against_truth(camera, view, tolerance):
    made, true = build_map(camera, view), truth(camera, view)
    assert made.map_x.dtype == made.map_y.dtype == np.float32
    assert made.map_x.shape == made.valid.shape == view.size[::-1]
    assert made.view == view
    assert made.image_size == camera.image_size
    inside = ~np.isnan(true[..., 0])
    # A pixel on the very edge may fall to either side by rounding.
    assert (inside != made.valid).mean() < 1e-3
    both = inside & made.valid
    assert both.any()
    got = np.stack([made.map_x, made.map_y], axis=-1)
    np.testing.assert_allclose(got[both], true[both], rtol=0, atol=tolerance)
    assert (got[~made.valid] == -1).all()
    return made


@pytest.mark.parametrize("angles", [{}, {"yaw_deg": 50, "pitch_deg": -20, "roll_deg": 70}])
@pytest.mark.parametrize("field", [40, 120, 170])
def test_the_map_is_the_projection_of_the_views_rays(angles, field):
    view = CentralView.with_field("perspective", field, (90, 70), rotation_from_angles(**angles))
    check_against_truth(LENS, view, 2e-5)


@pytest.mark.parametrize(
    "angles", [{}, {"yaw_deg": 50, "pitch_deg": -20, "roll_deg": 70}, {"yaw_deg": 180}]
)
@pytest.mark.parametrize("field", [40, 120, 170])
def test_the_cubic_cameras_fast_way_agrees_with_the_plain_one(angles, field):
    camera = cubic_camera()
    share = np.abs(camera.P) / np.linalg.norm(camera.P, axis=1, keepdims=True)
    assert share.min() > 1e-6  # no entry is idle
    view = CentralView.with_field("perspective", field, (90, 70), rotation_from_angles(**angles))
    if angles.get("yaw_deg") == 180 and field < 170:
        assert not build_map(camera, view).valid.any()
    elif angles.get("yaw_deg") != 180:
        check_against_truth(camera, view, 2e-5)


class Crop:
    """A camera whose photo is a part of the view, shifted by a part of a pixel."""

    image_size = (10, 8)
    max_angle_deg = 89.0

    def __init__(self, view, shift):
        self.view, self.shift = view, shift

    def project(self, points):
        pixel = points @ self.view.camera_matrix.T
        return pixel[..., :2] / pixel[..., 2:] - 5 + self.shift


@pytest.mark.parametrize(
    ("shift", "columns", "rows"), [(0.0, 10, 8), (0.25, 9, 7), (-0.25, 9, 7), (0.75, 9, 7)]
)
def test_only_pixels_with_four_neighbours_in_the_photo_are_valid(shift, columns, rows):
    view = CentralView(kind="perspective", size=(20, 20), focal=8.0)
    made = build_map(Crop(view, shift), view)
    assert made.valid.any(axis=0).sum() == columns
    assert made.valid.any(axis=1).sum() == rows
    assert made.valid.sum() == columns * rows
    assert made.map_x[made.valid].min() >= 0
    assert made.map_x[made.valid].max() <= 9
    assert made.map_y[made.valid].max() <= 7


@pytest.mark.parametrize("side", [(-3, 0), (3, 0), (0, -3), (0, 3)])
def test_each_edge_of_the_photo_counts_by_itself(side):
    view = CentralView(kind="perspective", size=(10, 8), focal=8.0)
    camera = Crop(view, 5.0)
    camera.project = lambda points: Crop.project(camera, points) + side
    columns, rows = build_map(camera, view).valid.any(axis=0), build_map(camera, view).valid.any(1)
    assert (columns.sum(), rows.sum()) == (10 - abs(side[0]), 8 - abs(side[1]))


def test_the_cubic_camera_takes_the_fast_way(monkeypatch):
    def slow(*_):
        raise AssertionError("projected ray by ray")

    monkeypatch.setattr(CubicCamera, "project", slow)
    assert build_map(
        cubic_camera(), CentralView(kind="perspective", size=(9, 9), focal=5.0)
    ).valid.all()


def test_the_cone_ends_where_the_camera_says():
    camera = cubic_camera(max_angle_deg=50.0)
    view = CentralView.with_field("perspective", 140, (201, 151))
    made = check_against_truth(camera, view, 2e-5)
    x, y = np.meshgrid(np.arange(201), np.arange(151))
    rays = view.rays(np.stack([x, y], axis=-1))
    angle = np.degrees(np.arctan2(np.hypot(rays[..., 0], rays[..., 1]), rays[..., 2]))
    assert not made.valid[angle > 50.001].any()
    assert made.valid[angle < 49.9].all()


def test_blocks_of_rows_leave_no_seam(monkeypatch):
    view = CentralView.with_field("perspective", 120, (90, 70), (0.1, -0.2, 0.3))
    for camera in (LENS, cubic_camera()):
        whole = build_map(camera, view)
        monkeypatch.setattr(maps, "_PIXELS_PER_BLOCK", 1000)
        parts = build_map(camera, view)
        monkeypatch.undo()
        np.testing.assert_array_equal(parts.valid, whole.valid)
        np.testing.assert_array_equal(parts.map_x, whole.map_x)
        np.testing.assert_array_equal(parts.map_y, whole.map_y)


def test_remap_by_the_map_shows_the_pixels_that_it_says():
    # A photo whose brightness is its own coordinate: bilinear reading gives the map back.
    photo = np.broadcast_to(np.arange(SIZE[0], dtype=np.float32), SIZE[::-1]).copy() + 1
    made = build_map(LENS, build_view(LENS))
    flat = cv2.remap(photo, made.map_x, made.map_y, cv2.INTER_LINEAR)
    assert made.valid.mean() > 0.5
    # cv2.remap rounds coordinates to 1/32 pixel.
    assert np.abs(flat - 1 - made.map_x)[made.valid].max() <= 1 / 32
    assert (flat[~made.valid] == 0).all()


def test_photos_too_large_for_remap_are_refused():
    with pytest.raises(ViewError, match="40000x10"):
        build_map(
            replace(LENS, image_size=(40_000, 10)),
            CentralView(kind="perspective", size=(4, 3), focal=2.0),
        )


def test_the_whole_picture_is_the_projection_at_full_size():
    camera = cubic_camera()
    view = build_view(camera)
    assert view.size == SIZE
    check_against_truth(camera, view, 2e-5)
    assert TRUE_LENS.image_size != SIZE
