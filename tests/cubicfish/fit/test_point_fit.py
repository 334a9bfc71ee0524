"""The point lift: exact where the truth is a ratio of cubics, and honest about its rank."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic
from scipy.spatial.transform import Rotation

from cubicfish import FitError, build_map
from cubicfish.fit.point_fit import calibrate_points, fit_ratio, ratio
from cubicfish.models import PointCamera
from cubicfish.models.lift import lift, lift_rotation
from cubicfish.scene.truth import rotation_matrix
from cubicfish.solve.subset import select, select_photos
from cubicfish.views.view import PlaneView

TARGET = synthetic.corner_of_three()


def one_photo(target, *, seed=8, noise=0.0, **options):
    pose = synthetic.poses_around(
        target, 1, seed=seed, distance=(0.3, 0.35), off_axis_deg=20, **options
    )
    return synthetic.synthetic_correspondences(target, pose, noise=noise, seed=1), pose[0]


def true_ratio(seed=0):
    """A P whose denominator is positive near 0."""
    P = 0.05 * np.random.default_rng(seed).standard_normal((3, 20))
    P[0, 16] += 1
    P[1, 17] += 1
    P[2, 19] = 1
    return P


@pytest.mark.parametrize(("planes", "rank"), [(1, 10), (2, 16), (3, 19), (4, 20)])
def test_rank_of_points_on_planes(planes, rank):
    rng = np.random.default_rng(3)
    points = []
    for _ in range(planes):
        turn = Rotation.random(random_state=int(rng.integers(1000))).as_matrix()
        points.append(np.column_stack([rng.uniform(-1, 1, (80, 2)), np.full(80, 0.2)]) @ turn)
    points = np.vstack(points)
    P = true_ratio()
    pixel = 200 * ratio(P, lift(points)) + 300
    fit = fit_ratio(points, pixel)
    assert fit.null.shape == (20 - rank, 20)
    assert np.abs(lift(points) @ fit.null.T).max(initial=0) < 1e-12
    np.testing.assert_allclose(fit.null @ fit.null.T, np.eye(20 - rank), atol=1e-12)
    for found in (fit.plain, fit.reweighted, fit.refined):
        np.testing.assert_allclose(ratio(found, lift(points)), pixel, atol=1e-4)
        np.testing.assert_allclose(found @ fit.null.T, 0, atol=1e-9)


def test_with_full_rank_the_truth_is_found_everywhere_between():
    rng = np.random.default_rng(0)
    P = true_ratio()
    pixel = 200 * ratio(P, lift(points := rng.uniform(-1, 1, (200, 3)))) + 300
    fit = fit_ratio(points, pixel)
    probe = rng.uniform(-1, 1, (300, 3))
    expected = 200 * ratio(P, lift(probe)) + 300
    np.testing.assert_allclose(ratio(fit.refined, lift(probe)), expected, atol=1e-5)


def test_each_stage_is_nearer_to_the_truth():
    rng = np.random.default_rng(1)
    P = true_ratio(2)
    P[2, 16:19] = 0.35, -0.3, 0.3  # denominators that differ widely
    points = rng.uniform(-1, 1, (400, 3))
    exact = 200 * ratio(P, lift(points)) + 300
    noisy = exact + 0.5 * rng.standard_normal(exact.shape)
    fit = fit_ratio(points, noisy)
    cost = [
        np.sum((ratio(found, lift(points)) - noisy) ** 2) for found in (fit.reweighted, fit.refined)
    ]
    assert cost[1] < 0.9999 * cost[0]
    error = [
        np.sqrt(np.mean((ratio(found, lift(points)) - exact) ** 2))
        for found in (fit.plain, fit.reweighted, fit.refined)
    ]
    assert error[0] > 1.2 * error[1]
    assert error[1] >= 0.99 * error[2]
    assert error[2] < 0.5 * np.sqrt(59 / 800) * 1.3


def test_one_photo_in_the_world_frame():
    pairs, _ = one_photo(TARGET, noise=0.1)
    result = calibrate_points(pairs)
    camera = result.camera
    assert (camera.frame, camera.rank, result.poses) == ("world", 19, None)
    assert 0.07 < result.errors.rms_px < 0.2
    assert np.isnan(result.fit.held_out_rms_px)
    np.testing.assert_allclose(
        camera.project(pairs.world) - pairs.pixel, result.residual, atol=1e-8
    )
    assert np.linalg.norm(camera.P) == pytest.approx(1)
    record = result.as_record()
    assert record["rank"] == 19
    assert record["corners"] == len(pairs.pixel)


def test_beyond_the_corners_there_is_no_answer():
    P = np.zeros((3, 20))
    P[0, 16] = P[1, 17] = P[2, 19] = 1
    camera = PointCamera(
        image_size=(100, 100),
        P=P,
        frame="world",
        offset=np.array([1.0, 0, 0]),
        scale=2.0,
        null=np.zeros((0, 20)),
        extent=1.5,
        valid=np.zeros((0, 2)),
    )
    found = camera.project([[3.9, 0, 0], [4.1, 0, 0], [1, 0, 2.9], [1, 0, -3.1], [np.nan, 0, 0]])
    np.testing.assert_allclose(found[[0, 2]], [[1.45, 0], [0, 0]])
    assert np.isnan(found[[1, 3, 4]]).all()


def test_off_the_boards_is_refused_with_the_reason():
    pairs, _ = one_photo(TARGET)
    camera = calibrate_points(pairs).camera
    camera.refuse_off_boards(pairs.world)
    off = pairs.world.mean(axis=0) + np.array([[5.0, 5, 5], [9, 3, 4]])
    assert np.isnan(camera.project(off)).all()
    with pytest.raises(FitError, match=r"off the boards: the corners gave P rank 19 of 20"):
        camera.refuse_off_boards(np.vstack([pairs.world, off]))
    floor = pairs.world[pairs.world[:, 2] == 0][:1]
    assert np.isfinite(camera.project(floor)).all()
    assert np.isnan(camera.project(floor + np.array([2000.0, 0, 0]))).all()


def test_four_walls_determine_the_volume():
    target = synthetic.box_of_four()
    pairs, _ = one_photo(target)
    camera = calibrate_points(pairs).camera
    assert camera.rank == 20
    camera.refuse_off_boards(pairs.world + 3.0)


def in_camera_frame(camera: PointCamera, rotation, translation) -> PointCamera:
    """The same camera for points of a camera frame: Xc = R X + t."""
    # (X − offset)/scale = Rᵀ (Xc − (t + R offset))/scale, and Φ(Rᵀ x) = L(Rᵀ) Φ(x).
    turned = lift_rotation(rotation.T)
    return replace(
        camera,
        P=camera.P @ turned,
        frame="camera",
        offset=translation + rotation @ camera.offset,
        null=np.linalg.qr((camera.null @ turned).T)[0].T if len(camera.null) else camera.null,
    )


def test_a_world_camera_takes_points_of_a_camera_frame():
    pairs, pose = one_photo(TARGET, noise=0.1)
    camera = calibrate_points(pairs).camera
    rotation, translation = rotation_matrix(pose[0]), np.asarray(pose[1], float)
    turned = in_camera_frame(camera, rotation, translation)
    points = pairs.world @ rotation.T + translation
    np.testing.assert_allclose(turned.project(points), camera.project(pairs.world), atol=1e-6)
    assert turned.rank == camera.rank
    with pytest.raises(FitError):
        turned.refuse_off_boards(points + 20)


@pytest.mark.slow
def test_several_photos_in_the_camera_frame():
    poses = synthetic.poses_around(TARGET, 6, seed=5)
    pairs = synthetic.synthetic_correspondences(TARGET, poses, noise=0.1, seed=2)
    result = calibrate_points(pairs)
    assert (result.camera.frame, result.camera.rank) == ("camera", 20)
    points = result.poses.apply(result.pairs.image, result.pairs.world)
    np.testing.assert_allclose(
        result.camera.project(points) - result.pairs.pixel, result.residual, atol=1e-7
    )
    assert result.errors.rms_px < 3
    assert result.errors.rms_px < result.fit.held_out_rms_px < 60
    assert np.isnan(calibrate_points(pairs, hold_out=False).fit.held_out_rms_px)
    assert len(result.as_record()["per_image"][0]["camera_from_world"]["translation"]) == 3


@pytest.mark.slow
def test_gross_corners_are_left_out():
    pairs, _ = one_photo(synthetic.box_of_four(), noise=0.1)
    pixel = pairs.pixel.copy()
    pixel[::25] += [14, -9]
    result = calibrate_points(replace(pairs, pixel=pixel))
    assert result.fit.dropped == len(pixel[::25])
    assert result.errors.rms_px < 0.25


def test_too_few_corners_are_refused():
    pairs, _ = one_photo(TARGET)
    few, _ = select(select_photos(pairs, np.array([0])), np.arange(len(pairs.pixel)) < 29)
    with pytest.raises(FitError, match="29 corners are too few"):
        calibrate_points(few)


def test_a_board_can_be_rectified():
    """The map of a board's plane leads each of its corners to the corner's own pixel."""
    pairs, _ = one_photo(TARGET)
    camera = calibrate_points(pairs).camera
    board = TARGET.boards[0]
    own = (pairs.board == 0) & (pairs.column > 0) & (pairs.row > 0)
    own &= (pairs.column < board.columns - 1) & (pairs.row < board.rows - 1)
    # Any frame in front of the board serves: the pose is not needed.
    rotation = np.stack([board.x_axis, board.y_axis, np.cross(board.x_axis, board.y_axis)])
    translation = np.array([0, 0, 1.0]) - rotation @ board.origin
    view = PlaneView(
        size=(200, 125),
        origin=(0.0, 0.0, 1.0),
        x_axis=(1.0, 0.0, 0.0),
        y_axis=(0.0, 1.0, 0.0),
        pixels_per_unit=1.0,
    )
    found = build_map(in_camera_frame(camera, rotation, translation), view)
    column = np.round(pairs.column[own] * board.square).astype(int)
    row = np.round(pairs.row[own] * board.square).astype(int)
    seen = np.stack([found.map_x[row, column], found.map_y[row, column]], axis=-1)
    exact = camera.project(pairs.world[own])
    assert found.valid[row, column].all()
    np.testing.assert_allclose(seen, exact, atol=1e-3)
    assert np.linalg.norm(exact - pairs.pixel[own], axis=1).max() < 0.5
