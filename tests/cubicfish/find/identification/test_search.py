import numpy as np
import pytest
from anonymous_grids import anonymous, anonymous_photos
from hypothesis import given
from hypothesis import strategies as st
from looking import look_at
from synthetic import (
    IMAGE_SIZE,
    checkerboard,
    corner_of_three,
    flat_board,
    poses_around,
    synthetic_corners,
)

from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.allowed_offsets import find_allowed_offsets
from cubicfish.find.identification.decide import CLEAR_RATIO, decide, decide_alone
from cubicfish.find.identification.ends import Ends, ends_of
from cubicfish.find.identification.identified import Decided, Place
from cubicfish.find.identification.scene import grid_poses, view_of
from cubicfish.find.identification.search import (
    form_cost,
    gauss_newton,
    grid_moments,
    normal_equations,
    search,
)
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.poses import rotation_from_vector
from cubicfish.target.placement import placement_of
from cubicfish.target.target import Target

LENS = RadialCamera(
    image_size=IMAGE_SIZE, fx=262.0, fy=262.6, cx=485.3, cy=352.8, k=np.array([-0.02, -0.004, 0, 0])
)

NO_PIXEL = np.empty((0, 2))


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


@pytest.mark.slow
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
    sides = placement_of(target)
    poses = grid_poses(LENS, grids, IMAGE_SIZE)
    views = [
        view_of(LENS, grid, pose, find_allowed_offsets(grid.cells, grid.parity, sides))
        for grid, pose in zip(grids, poses, strict=True)
    ]
    ends = [
        ends_of(
            LENS,
            grid,
            np.column_stack([pose.rotation[0][:, :2], pose.translation[0]]),
            np.concatenate([one.pixel for one in grids if one is not grid]),
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
    assert decide(grids, sides, found, ends).verdict == (Decided.NAMED,) * len(grids)
    two = found[np.array([0, 0])]
    two.offset[1, 1] += 1
    two.grid_cost[1, 1] *= ratio**2
    decision = decide(grids, sides, two, ends)
    right = Decided.NAMED if ratio > CLEAR_RATIO else Decided.AMBIGUOUS
    assert decision.verdict == (Decided.NAMED, right, Decided.NAMED)
    assert decision.ratio[1] == pytest.approx(ratio)
    *_, all_ends = one_photo()
    assert decide(grids, sides, two, all_ends).verdict == (Decided.NAMED,) * len(grids)


def test_nothing_goes_with_a_single_grid():
    *_, sides, views, _ = one_photo()
    assert len(search(views[:1], sides)) == 0


@pytest.mark.parametrize(("lost", "count"), [(0, 0), (1, 8), (2, 16)])
def test_corners_are_missing_where_a_board_goes_on_unseen(lost, count):
    """A board whose last columns were not found, in the middle of the picture."""
    target = flat_board()
    sides = placement_of(target)
    cells = np.indices((11 - lost, 8)).reshape(2, -1).T
    form = np.column_stack([np.eye(3)[:, :2], [-5.0, -3.5, 10.0]])
    pixel = LENS.project(np.column_stack([cells, np.ones(len(cells))]) @ form.T)
    # the colours of place (0, 0): the square down-right of corner (0, 0) is dark
    grid = Grid(cells=cells, pixel=pixel, parity=-1, step=26.0, contrast=np.full(len(cells), 9.0))
    ends = ends_of(LENS, grid, form, NO_PIXEL, farthest=2.0)
    missing = ends.missing(sides, np.array([0]), np.array([[0, 0]]))
    assert missing[0] == count
    hidden = ends_of(LENS, grid, form, NO_PIXEL, farthest=0.0)
    assert hidden.missing(sides, np.array([0]), np.array([[0, 0]]))[0] == 0


def test_places_are_charged_for_the_room_that_they_leave():
    target = flat_board()
    sides = placement_of(target)
    cells = np.indices((5, 4)).reshape(2, -1).T
    form = np.column_stack([np.eye(3)[:, :2], [-2.0, -1.5, 6.0]])
    pixel = LENS.project(np.column_stack([cells, np.ones(len(cells))]) @ form.T)
    grid = Grid(cells=cells, pixel=pixel, parity=-1, step=40.0, contrast=np.full(20, 9.0))
    ends = ends_of(LENS, grid, form, NO_PIXEL, farthest=2.0)
    side, offset = find_allowed_offsets(grid.cells, grid.parity, sides).places()
    missing = ends.missing(sides, side, offset)
    corner = (side == 0) & (offset == [0, 0]).all(axis=1)
    middle = (side == 0) & (offset == [3, 1]).all(axis=1)
    assert 0 < missing[corner][0] < missing[middle][0]
    assert missing.max() == ends.table.max()


def test_corners_of_another_grid_are_not_missing():
    target = flat_board()
    sides = placement_of(target)
    cells = np.indices((11, 8)).reshape(2, -1).T
    form = np.column_stack([np.eye(3)[:, :2], [-5.0, -3.5, 10.0]])
    pixel = LENS.project(np.column_stack([cells, np.ones(len(cells))]) @ form.T)
    left = cells[:, 0] < 6
    piece = Grid(
        cells=cells[left], pixel=pixel[left], parity=-1, step=26.0, contrast=np.full(48, 9.0)
    )
    place = np.array([0]), np.array([[0, 0]])
    alone = ends_of(LENS, piece, form, NO_PIXEL, farthest=2.0)
    assert alone.missing(sides, *place)[0] == 16
    both = ends_of(LENS, piece, form, pixel[~left] + 1.0, farthest=2.0)
    assert both.missing(sides, *place)[0] == 0


def test_two_grids_may_not_claim_the_same_corners():
    grids, _, sides, views, ends = one_photo()
    two = search(views, sides)[np.array([0, 0])]
    two.side[0, 1], two.offset[0, 1] = two.side[0, 0], two.offset[0, 0]
    two.grid_cost[0] /= 100
    decision = decide(grids, sides, two, ends)
    np.testing.assert_array_equal(decision.side, two.side[1])
    np.testing.assert_array_equal(decision.offset, two.offset[1])


def trough() -> Target:
    """A floor and a wall of 16x6 corners that run along the same edge."""
    return Target(
        units="mm",
        boards=(
            checkerboard("floor", 16, 6, 30.0, (0, 200, 0), (1, 0, 0), (0, -1, 0)),
            checkerboard("wall", 16, 6, 30.0, (450, 0, 200), (-1, 0, 0), (0, 0, -1)),
        ),
    )


def test_a_slide_along_a_common_edge_is_told_by_an_end_or_not_at_all():
    target = trough()
    sides = placement_of(target)
    pose = look_at([200, 330, 300], [210, 60, 60])
    corners = synthetic_corners(target, [pose], lens=LENS, noise=0.1)
    x = 30.0 * corners.column
    x = np.where(corners.board == 0, x, 450 - x)
    middle = (x > 100) & (x < 320)
    rng = np.random.default_rng(2)
    both = [anonymous(corners, target, middle & (corners.board == b), rng) for b in (0, 1)]
    grids, truth = [grid for grid, _ in both], [place for _, place in both]
    poses = grid_poses(LENS, grids, IMAGE_SIZE)
    views = [
        view_of(LENS, grid, pose, find_allowed_offsets(grid.cells, grid.parity, sides))
        for grid, pose in zip(grids, poses, strict=True)
    ]
    found = search(views, sides)
    slide = decide(grids, sides, found, [Reported(None), Reported(None)])
    assert slide.verdict == (Decided.SLIDE, Decided.SLIDE)
    reported = decide(grids, sides, found, [Reported(truth[0]), Reported(None)])
    assert reported.verdict == (Decided.NAMED, Decided.NAMED)
    assert [
        (int(sides.board[side]), int(sides.turn[side]), *map(int, offset))
        for side, offset in zip(reported.side, reported.offset, strict=True)
    ] == [(place.board, place.turn, place.column, place.row) for place in truth]


class Reported(Ends):
    """Ends of which only what they say is of interest: all places but one miss corners."""

    def __init__(self, place: Place | None) -> None:
        super().__init__(table=np.zeros((3, 3, 3, 3), np.intp), last=np.zeros(2, np.intp))
        object.__setattr__(self, "place", place)

    def missing(self, sides, side, offset):
        if self.place is None:
            return np.zeros(len(side), np.intp)
        right = (sides.board[side] == self.place.board) & (sides.turn[side] == self.place.turn)
        right &= (offset == [self.place.column, self.place.row]).all(axis=1)
        return np.where(right, 0, 20)


def test_a_grid_that_fills_a_board_is_that_board():
    target = Target(
        units="mm",
        boards=(
            checkerboard("large", 12, 9, 30.0),
            checkerboard("small", 8, 5, 30.0, (0, 0, 300)),
        ),
    )
    sides = placement_of(target)
    for size, verdict in (((8, 5), Decided.NAMED), ((7, 5), Decided.SLIDE)):
        cells = np.indices(size).reshape(2, -1).T
        grid = Grid(
            cells=cells, pixel=10.0 * cells, parity=-1, step=10.0, contrast=np.full(len(cells), 9.0)
        )
        alone = decide_alone(
            grid, sides, find_allowed_offsets(grid.cells, grid.parity, sides), None
        )
        assert alone.verdict == (verdict,)
        if verdict is Decided.NAMED:
            assert sides.board[alone.side[0]] == 1
            assert alone.offset[0].tolist() == [0, 0]


@pytest.mark.parametrize(("size", "verdict"), [((8, 5), Decided.TWIN), ((7, 4), Decided.SLIDE)])
def test_one_of_two_boards_alike_is_not_guessed(size, verdict):
    twins = (checkerboard("a", 8, 5, 30.0), checkerboard("b", 8, 5, 30.0, (0, 0, 300)))
    target = Target(units="mm", boards=(*twins, checkerboard("c", 4, 3, 30.0, (70, 0, 100))))
    sides = placement_of(target)
    cells = np.indices(size).reshape(2, -1).T
    grid = Grid(
        cells=cells, pixel=10.0 * cells, parity=-1, step=10.0, contrast=np.full(len(cells), 9.0)
    )
    assert decide_alone(
        grid, sides, find_allowed_offsets(grid.cells, grid.parity, sides), None
    ).verdict == (verdict,)


def test_a_narrow_lens_leaves_two_poses_of_a_plane_and_a_wide_one_does_not():
    """From afar a plane may lean either way (Necker 1832); perspective tells nearby."""
    cells = np.indices((7, 6)).reshape(2, -1).T
    turn = rotation_from_vector([0.5, 0.3, 0.2])
    rng = np.random.default_rng(0)
    for camera, distance, count in (
        (
            RadialCamera(image_size=IMAGE_SIZE, fx=9e4, fy=9e4, cx=480, cy=360, k=np.zeros(4)),
            3000,
            2,
        ),
        (LENS, 8, 1),
    ):
        points = np.column_stack([cells - cells.mean(axis=0), np.zeros(len(cells))]) @ turn.T
        pixel = camera.project(points + np.array([0.1, 0.2, distance]))
        pixel += 0.2 * rng.standard_normal(pixel.shape)
        grid = Grid(cells=cells, pixel=pixel, parity=1, step=25.0, contrast=np.full(42, 9.0))
        (pose,) = grid_poses(camera, [grid], IMAGE_SIZE)
        assert len(pose.rotation) == count
        angles = [np.degrees(np.arccos((np.trace(r @ turn.T) - 1) / 2)) for r in pose.rotation]
        assert min(angles) < 3


def test_corners_on_no_plane_have_no_pose():
    grid, _ = plane(0)
    bent = grid.pixel + 8.0 * np.sin(grid.cells)
    both = [grid, Grid(cells=grid.cells, pixel=bent, parity=1, step=30.0, contrast=grid.contrast)]
    good, bad = grid_poses(LENS, both, IMAGE_SIZE)
    assert good is not None
    assert good.rms_px < 0.01
    assert bad is None
