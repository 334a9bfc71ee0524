import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from hypothesis import given
from hypothesis import strategies as st
from synthetic import IMAGE_SIZE, corner_of_three, flat_board, poses_around, synthetic_corners

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.fitting.poses import rotation_from_vector
from cubicfish_cli.model.radial import RadialCamera
from cubicfish_cli.naming.decide import CLEAR_RATIO, Verdict, decide
from cubicfish_cli.naming.ends import ends_of
from cubicfish_cli.naming.moments import form_cost, gauss_newton, grid_moments, normal_equations
from cubicfish_cli.naming.places import reach_of, sides_of
from cubicfish_cli.naming.search import search
from cubicfish_cli.naming.views import grid_poses, view_of

LENS = RadialCamera(
    image_size=IMAGE_SIZE, fx=262.0, fy=262.6, cx=485.3, cy=352.8, k=np.array([-0.02, -0.004, 0, 0])
)


def plane(seed: int, *, columns: int = 6, rows: int = 5) -> tuple[Grid, np.ndarray]:
    """A grid seen askew, and its (i, j, 1) -> camera frame, in squares."""
    rng = np.random.default_rng(seed)
    cells = np.indices((columns, rows)).reshape(2, -1).T
    turn = rotation_from_vector(0.4 * rng.standard_normal(3))
    middle = np.array([*rng.uniform(-4, 4, 2), rng.uniform(6, 10)])
    form = np.column_stack([turn[:, :2], middle - turn[:, :2] @ cells.mean(axis=0)])
    pixel = LENS.project(np.column_stack([cells, np.ones(len(cells))]) @ form.T)
    grid = Grid(cells=cells, pixel=pixel, parity=1, step=30.0, contrast=np.full(len(cells), 100.0))
    return grid, form


@given(st.integers(0, 10_000))
def test_moments_give_the_reprojection_error_of_small_moves(seed):
    grid, form = plane(seed)
    moments = grid_moments(LENS, grid.cells, grid.pixel, form)
    assert form_cost(moments, form) == pytest.approx(0, abs=1e-6)
    rng = np.random.default_rng(seed)
    turned = rotation_from_vector(1e-4 * rng.standard_normal(3)) @ form
    turned[:, 2] += 1e-3 * rng.standard_normal(3)
    homogeneous = np.column_stack([grid.cells, np.ones(len(grid))])
    true = np.square(LENS.project(homogeneous @ turned.T) - grid.pixel).sum()
    assert form_cost(moments, turned) == pytest.approx(true, rel=0.02)


def test_derivatives_of_the_error_agree_with_differences():
    grid, form = plane(3)
    moments = grid_moments(LENS, grid.cells, grid.pixel, form)
    square = np.array([2.0])
    moved = rotation_from_vector([0.02, -0.03, 0.01]) @ form * square
    pivot = np.array([[0.3, -0.2, 9.0]])
    cost, gradient, hessian = normal_equations(moments, moved[None], pivot, square)
    assert cost[0] == pytest.approx(float(form_cost(moments, moved / square)))
    for axis in range(6):
        step = np.zeros(6)
        step[axis] = 1e-6
        turn = rotation_from_vector(step[:3])
        after = turn @ moved
        after[:, 2] += pivot[0] - turn @ pivot[0] + step[3:]
        slope = (form_cost(moments, after / square) - cost[0]) / 1e-6
        assert 2 * gradient[0, axis] == pytest.approx(float(slope), rel=1e-3, abs=1e-2)
    shift, decrease = gauss_newton(gradient, hessian)
    assert decrease[0] == pytest.approx(cost[0], rel=0.05)  # the truth costs nothing
    assert np.linalg.norm(shift) > 0.01


def one_photo(seed=0, *, noise=0.1, target=None, farthest=2.0):
    target = target or corner_of_three()
    corners = synthetic_corners(
        target, poses_around(target, 1, off_axis_deg=40, seed=seed), lens=LENS, noise=noise
    )
    (grids,), (truth,) = anonymous_photos(corners, target)
    sides = sides_of(target)
    poses = grid_poses(LENS, grids, IMAGE_SIZE)
    views = [
        view_of(LENS, grid, pose, reach_of(grid, sides))
        for grid, pose in zip(grids, poses, strict=True)
    ]
    ends = [
        ends_of(
            LENS,
            grid,
            np.column_stack([pose.rotation[0][:, :2], pose.translation[0]]),
            np.concatenate([one.pixel for one in grids]),
            farthest,
        )
        for grid, pose in zip(grids, poses, strict=True)
    ]
    return grids, truth, sides, views, ends


def test_the_true_labeling_comes_first_with_its_pose_and_noise():
    grids, truth, sides, views, _ = one_photo(noise=0.2)
    found = search(views, sides)
    assert (np.diff(found.cost) >= 0).all()
    assert [int(sides.board[side]) for side in found.side[0]] == [place.board for place in truth]
    assert [tuple(offset) for offset in found.offset[0]] == [(p.column, p.row) for p in truth]
    corners = sum(map(len, grids))
    assert np.sqrt(found.cost[0] / corners) == pytest.approx(0.2 * np.sqrt(2), rel=0.15)
    assert found.cost[1] > 4 * found.cost[0]
    keys = np.concatenate([found.side, found.offset.reshape(len(found), -1)], axis=1)
    assert len(np.unique(keys, axis=0)) == len(keys)


@pytest.mark.parametrize("ratio", [CLEAR_RATIO - 0.05, CLEAR_RATIO + 0.05])
def test_a_rival_within_the_ratio_makes_its_own_grid_ambiguous_unless_ends_are_seen(ratio):
    grids, _, sides, views, ends = one_photo(farthest=0)  # no end is seen
    found = search(views, sides)
    assert decide(grids, sides, found, ends).verdict == (Verdict.NAMED,) * len(grids)
    two = found[np.array([0, 0])]
    two.offset[1, 1] += 1
    two.grid_cost[1, 1] *= ratio**2
    decision = decide(grids, sides, two, ends)
    right = Verdict.NAMED if ratio > CLEAR_RATIO else Verdict.AMBIGUOUS
    assert decision.verdict == (Verdict.NAMED, right, Verdict.NAMED)
    assert decision.ratio[1] == pytest.approx(ratio)
    *_, all_ends = one_photo()
    assert decide(grids, sides, two, all_ends).verdict == (Verdict.NAMED,) * len(grids)


def test_nothing_goes_with_a_single_grid():
    *_, sides, views, _ = one_photo()
    assert len(search(views[:1], sides)) == 0


@pytest.mark.parametrize(("lost", "count"), [(0, 0), (1, 8), (2, 16)])
def test_corners_are_missing_where_a_board_goes_on_unseen(lost, count):
    """A board whose last columns were not found, in the middle of the picture."""
    target = flat_board()
    sides = sides_of(target)
    cells = np.indices((11 - lost, 8)).reshape(2, -1).T
    form = np.column_stack([np.eye(3)[:, :2], [-5.0, -3.5, 10.0]])
    pixel = LENS.project(np.column_stack([cells, np.ones(len(cells))]) @ form.T)
    # the colours of place (0, 0): the square down-right of corner (0, 0) is dark
    grid = Grid(cells=cells, pixel=pixel, parity=-1, step=26.0, contrast=np.full(len(cells), 9.0))
    ends = ends_of(LENS, grid, form, pixel, farthest=2.0)
    missing = ends.missing(sides, np.array([0]), np.array([[0, 0]]))
    assert missing[0] == count
    hidden = ends_of(LENS, grid, form, pixel, farthest=0.0)
    assert hidden.missing(sides, np.array([0]), np.array([[0, 0]]))[0] == 0


def test_places_are_charged_for_the_room_that_they_leave():
    target = flat_board()
    sides = sides_of(target)
    cells = np.indices((5, 4)).reshape(2, -1).T
    form = np.column_stack([np.eye(3)[:, :2], [-2.0, -1.5, 6.0]])
    pixel = LENS.project(np.column_stack([cells, np.ones(len(cells))]) @ form.T)
    grid = Grid(cells=cells, pixel=pixel, parity=-1, step=40.0, contrast=np.full(20, 9.0))
    ends = ends_of(LENS, grid, form, pixel, farthest=2.0)
    side, offset = reach_of(grid, sides).places()
    missing = ends.missing(sides, side, offset)
    corner = (side == 0) & (offset == [0, 0]).all(axis=1)
    middle = (side == 0) & (offset == [3, 1]).all(axis=1)
    assert 0 < missing[corner][0] < missing[middle][0]
    assert missing.max() == ends.table.max()
