"""What tells wrong set-ups apart: each piece on exact truth, and on noise in which nothing is."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import synthetic
import wrong_setups as wrong
from asymmetric_lens import AsymmetricLens
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import synthetic_lens
from told import raises_told

from cubicfish.calibration import calibrate
from cubicfish.diagnosis import photo_lenses, rejected_photos, two_lenses, wrong_nominal
from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.diagnosis.mirrored import handed, mirrored_object, seen_sides
from cubicfish.diagnosis.object_faults import object_fault
from cubicfish.diagnosis.photo_lenses import (
    BY_CHANCE,
    PhotoLenses,
    Unlike,
    unlike,
)
from cubicfish.diagnosis.rejected_photos import (
    board_fault,
    board_findings,
    failed_lens,
    left_out_lens,
)
from cubicfish.diagnosis.two_lenses import best_split, lens_change
from cubicfish.diagnosis.wrong_nominal import measured_object
from cubicfish.errors import FitError
from cubicfish.fit import radial_reference
from cubicfish.fit.calibration import CornerEvidence, FailedFit
from cubicfish.fit.folds import NEAR_SHARE, repeated_groups
from cubicfish.geometry import similarity
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.uncertainty import UncertaintyGrid
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import local_noise_px, neighbours
from cubicfish.solve.subset import select, select_photos, world_scale
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.wording import listed
from cubicfish_cli.words.phrases import percent
from cubicfish_cli.words.sentences import render

TARGET = wrong.corner_of_half_a_metre()
NINE_BY_SIX = Target(units="mm", boards=(synthetic.checkerboard("board", 9, 6, 30.0),))
LENS = RadialCamera(
    image_size=synthetic.IMAGE_SIZE, fx=262.0, fy=262.6, cx=485.3, cy=352.8,
    k=np.array([-0.021, -0.0042, 0.0011, -0.00012]),
)  # fmt: skip
POSES = synthetic.poses_around(TARGET, 8, seed=5)


def as_poses(poses):
    return Poses(
        rotation=Rotation.from_rotvec([pose[0] for pose in poses]).as_matrix(),
        translation=np.array([pose[1] for pose in poses]),
    )


@pytest.fixture(scope="module")
def pairs():
    return synthetic.synthetic_correspondences(TARGET, POSES, lens=LENS, noise=0.1, seed=6)


@pytest.fixture(scope="module")
def exact():
    return synthetic.synthetic_correspondences(TARGET, POSES, lens=LENS)


def mirrored(pairs, which):
    pixel = pairs.pixel.copy()
    pixel[which, 0] = pairs.image_size[0] - 1 - pixel[which, 0]
    return replace(pairs, pixel=pixel)


# Findings in words


def test_a_finding_is_one_line_and_plain_data():
    figures = {"in_order": True, "where": "from", "rest": [], "focal_off": 0.05, "own_px": 0.1}
    finding = Finding(
        code=Code.ZOOM, severity=Severity.BAD, images=("a",), because="own_lens", figures=figures
    )
    assert render(finding).line == (
        "the focal length differs by +5 % from a on: zoom or focus changed, or photos of two "
        "cameras are mixed (fitted separately, they reach 0.10 px); calibrate each setting and "
        "camera separately, with zoom and focus locked"
    )
    assert finding.as_record() == {
        "cause": "zoom", "code": "zoom", "case": "", "level": "bad", "severity": "bad",
        "remedy": "separate_photos", "what": str(finding), "evidence": "", "do": "",
        "images": ["a"], "boards": [], "figures": figures,
    }  # fmt: skip


def test_names_are_listed_up_to_six():
    names = list("abcdefg")
    assert listed(names[:1], "photos") == "a"
    assert listed(names[:2], "photos") == "a and b"
    assert listed(names[:6], "photos") == "a, b, c, d, e and f"
    assert listed(names, "photos") == "a, b, c, d and 3 more photos"
    assert percent(0.0123) == "+1.2 %"
    assert percent(-0.05) == "-5 %"


# Which way round


def test_boards_are_seen_from_their_face_or_mirrored(exact):
    sides = seen_sides(exact)
    assert set(np.unique(sides)) <= {0, 1}
    assert (sides == 1).sum() > 0.9 * sides.size
    photo = exact.image == 3
    against = seen_sides(mirrored(exact, photo))
    np.testing.assert_array_equal(against[3], -sides[3])
    np.testing.assert_array_equal(np.delete(against, 3, 0), np.delete(sides, 3, 0))
    (some,) = handed(CornerEvidence(pairs=mirrored(exact, photo), target=None))
    assert (some.code, some.severity, some.images) == ("mirrored", "note", ("03.png",))
    assert not handed(CornerEvidence(pairs=exact, target=None))
    # As many one way as the other: nobody knows which.
    assert not handed(CornerEvidence(pairs=mirrored(exact, exact.image < 4), target=None))


def test_few_squares_and_lists_of_points_have_no_side(exact):
    few, _ = select(exact, (exact.column < 2) & (exact.row < 2))
    assert not seen_sides(few).any()
    points = replace(exact, board=np.full(len(exact.board), -1), boards=())
    assert not seen_sides(points).any()
    assert local_noise_px(points, np.ones((len(points.pixel), 2))) == 0


def test_neighbours_are_of_the_same_board_and_photo(exact):
    right, down = neighbours(exact)
    for other, step in ((right, (1, 0)), (down, (0, 1))):
        found = other >= 0
        assert found.mean() > 0.8
        for name in ("image", "board"):
            values = getattr(exact, name)
            np.testing.assert_array_equal(values[other[found]], values[found])
        np.testing.assert_array_equal(exact.column[other[found]] - exact.column[found], step[0])
        np.testing.assert_array_equal(exact.row[other[found]] - exact.row[found], step[1])
    assert (exact.column[right < 0] > 0).all()


def test_local_noise_is_the_noise_and_not_what_goes_together(exact):
    noise = np.random.default_rng(0).normal(0, 0.2, exact.pixel.shape)
    smooth = 5 * np.stack([exact.pixel[:, 1] / 500, -exact.pixel[:, 0] / 500], axis=-1)
    for residual in (noise, noise + smooth):
        assert local_noise_px(exact, residual) == pytest.approx(0.2, rel=0.1)


# Photos that say the same


def test_copies_and_photos_from_one_place_are_reported(exact):
    rotation, translation = as_poses(POSES).rotation, as_poses(POSES).translation
    rng = np.random.default_rng(0)
    again = np.array([0, 1, 2, 1, 3, 0])
    jitter = 1e-4 * rng.standard_normal((6, 3))
    poses = Poses(
        rotation=Rotation.from_rotvec(jitter).as_matrix() @ rotation[again],
        translation=translation[again] * (1 + jitter),
    )
    group = repeated_groups(poses, exact, LENS.fx)
    np.testing.assert_array_equal(group, [0, 1, 2, 1, 3, 0])
    # Much farther apart they are not copies, but still at one place.
    apart = Poses(
        rotation=Rotation.from_rotvec(300 * jitter).as_matrix() @ rotation[[0] * 6],
        translation=translation[[0] * 6] * (1 + 300 * jitter),
    )
    assert repeated_groups(apart, exact, LENS.fx).max() == 5
    assert repeated_groups(apart, exact, LENS.fx, NEAR_SHARE).max() == 0
    assert repeated_groups(as_poses(POSES), exact, LENS.fx, NEAR_SHARE).max() == 7
    # From one place, but turned about the line of sight: the object lies elsewhere in the picture.
    rolls = Rotation.from_rotvec([[0, 0, angle] for angle in (0, 0.4, 0.8)]).as_matrix()
    turned = Poses(rotation=rolls @ rotation[0], translation=rolls @ translation[0])
    assert repeated_groups(turned, exact, LENS.fx, NEAR_SHARE).max() == 2
    spun = Poses(rotation=rolls @ rotation[0], translation=translation[[0] * 3])
    assert repeated_groups(spun, exact, LENS.fx).max() == 2


def test_copies_are_told_by_their_place_where_names_are_uncertain(exact):
    """Of a part of a board each copy may be named some rows further on, and placed so."""
    shift = np.array([40.0, 0.0, 0.0])  # millimetres, as a square of the board
    again = np.array([0, 1, 0, 2, 1, 1])
    rows = [np.flatnonzero(exact.image == photo) for photo in again]
    whole = np.concatenate(rows)
    pairs = replace(
        exact.select(whole),
        images=tuple("abcdef"),
        image=np.repeat(np.arange(6), [len(own) for own in rows]),
    )
    poses = as_poses(POSES)[again]
    translation = poses.translation.copy()
    translation[[2, 4, 5]] += poses.rotation[[2, 4, 5]] @ shift
    poses = Poses(rotation=poses.rotation, translation=translation)
    # The photos c and e are uncertain; f is not, and its place is what its pose says.
    unsure = replace(pairs, certain=~np.isin(pairs.image, [2, 4]))
    np.testing.assert_array_equal(repeated_groups(poses, pairs, LENS.fx), [0, 1, 2, 3, 4, 4])
    np.testing.assert_array_equal(repeated_groups(poses, unsure, LENS.fx), [0, 1, 0, 2, 1, 3])


# The drawing beside the object as measured


def measured(target=TARGET, *, seed=None, noise=0.0):
    """All corners of an object, in any frame and unit."""
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=rng).as_matrix() if seed is not None else np.eye(3)
    scale, shift = (1.0, 0.0) if seed is None else (np.exp(rng.normal()), rng.normal(0, 100, 3))
    found = {}
    for index, board in enumerate(target.boards):
        row, column = (part.ravel() for part in np.indices((board.rows, board.columns)))
        points = board.world_points(column, row)
        points = points + rng.normal(0, noise, points.shape)
        found[index] = scale * points @ turn.T + shift
    return found


def test_a_right_drawing_has_no_fault():
    assert object_fault(TARGET, measured(seed=1)) is None
    # Nothing simple explains corners that are all a little off.
    assert object_fault(TARGET, measured(seed=2, noise=0.5)) is None
    # One board has nothing beside it to be compared with.
    one = {0: measured(seed=3)[0]}
    assert object_fault(wrong.with_board(TARGET, 0, square=40.0), one) is None


@given(
    seed=st.integers(0, 1000),
    board=st.integers(0, 2),
    ratio=st.floats(0.5, 2.0).filter(lambda ratio: abs(ratio - 1) > 0.005),
)
@settings(max_examples=5)
def test_a_wrong_square_is_measured_in_any_frame(seed, board, ratio):
    drawn = wrong.with_board(TARGET, board, square=36.0 * ratio)
    fault = object_fault(drawn, measured(seed=seed, noise=0.01))
    found = fault.finding
    assert (found.code, found.boards) == ("board_square", (TARGET.boards[board].name,))
    assert 1 + found.figures["off"] == pytest.approx(1 / ratio, rel=1e-3)
    assert fault.after < 0.1 * fault.before


@pytest.mark.parametrize("ratio", [1.04, 25.4, 1 / 25.4])
def test_all_squares_are_measured_by_the_distances_between_boards(ratio):
    drawn = TARGET
    for board in range(3):
        drawn = wrong.with_board(drawn, board, square=36.0 * ratio)
    found = object_fault(drawn, measured(seed=4)).finding
    assert (found.code, found.boards) == ("board_square", TARGET.board_names)
    assert 1 + found.figures["off"] == pytest.approx(1 / ratio, rel=1e-4)


@given(seed=st.integers(0, 1000), board=st.integers(0, 2), length=st.floats(0.5, 20))
@settings(max_examples=5)
def test_a_wrong_place_is_measured_in_any_frame(seed, board, length):
    rng = np.random.default_rng(seed)
    drawn = wrong.shifted(wrong.turned(TARGET, board, 1.0, rng), board, length, rng)
    found = object_fault(drawn, measured(seed=seed, noise=0.01)).finding
    assert (found.code, found.case) == ("board_place", "")
    assert found.boards == (TARGET.boards[board].name,)
    assert found.figures["shift"] == pytest.approx(length, rel=0.05)
    assert found.figures["turn_deg"] == pytest.approx(1.0, rel=0.05)


def test_a_board_of_another_size_elsewhere():
    drawn = wrong.shifted(TARGET, 1, 40.0, np.random.default_rng(0))
    drawn = wrong.with_board(drawn, 1, square=40.0)
    found = object_fault(drawn, measured(seed=5)).finding
    assert (found.code, found.case, found.boards) == ("board_place", "and_square", ("wall",))
    assert 1 + found.figures["off"] == pytest.approx(0.9, rel=1e-3)


def test_axes_names_orders_and_mirrors():
    flipped = wrong.with_board(TARGET, 2, y_axis=-TARGET.boards[2].y_axis)
    found = object_fault(flipped, measured(seed=6)).finding
    assert (found.code, found.boards) == ("board_order", ("side",))
    assert (found.figures["order"], found.figures["which"]) == ("y_axis", "one")
    through_glass = {index: points * [1, -1, 1] for index, points in measured(seed=7).items()}
    assert object_fault(TARGET, through_glass).finding.code == "mirrored"
    equal = wrong.equal_corner()
    found = measured(equal, seed=8)
    found[0], found[1] = found[1], found[0]
    fault = object_fault(equal, found)
    assert (fault.finding.code, fault.finding.boards) == ("board_names", equal.board_names[:2])
    np.testing.assert_allclose(
        fault.points[0], measured(equal)[1], atol=1e-9, err_msg="where the corners really are"
    )
    found = measured(equal, seed=9)
    found = {i: one.reshape(7, 7, 3).transpose(1, 0, 2).reshape(-1, 3) for i, one in found.items()}
    fault = object_fault(equal, found)
    assert (fault.finding.code, fault.finding.boards) == ("board_order", equal.board_names)
    assert fault.finding.figures == {"order": "exchanged", "which": "all"}


def test_the_object_is_measured_from_photos_without_its_drawing(pairs):
    drawn = wrong.shifted(TARGET, 1, 90.0, np.random.default_rng(0))
    drawn = wrong.with_board(drawn, 2, square=1.4)
    scaled = replace(pairs.with_target(drawn), world=np.zeros_like(pairs.world))
    found = measured_object(scaled, drawn)
    assert sorted(found) == [0, 1, 2]
    seen, truth = [], []
    for index, points in found.items():
        seen.append(points)
        truth.append(TARGET.boards[index].world_points(*TARGET.boards[index].places()))
    seen, truth = np.concatenate(seen), np.concatenate(truth)
    miss = similarity(seen, truth)(seen) - truth
    assert np.abs(miss).max() < 0.5  # mm, of an object of half a metre


# One lens for all photos


def own_lenses(rng, count=14, wild=1.0):
    """Photos through one lens: what each has of its own is noise, ``wild`` times as large."""
    root = rng.normal(size=(count, 5, 5)) * [3, 1, 1, 2, 2]
    information = root @ root.transpose(0, 2, 1) + np.eye(5)
    own = np.linalg.solve(np.linalg.cholesky(information).transpose(0, 2, 1),
                          rng.normal(size=(count, 5, 1)))[:, :, 0]  # fmt: skip
    numbers = np.full(count, 200.0)
    return PhotoLenses(
        photos=np.arange(count), own=wild * own, information=information,
        squares=rng.chisquare(numbers), numbers=numbers, half_side=480.0,
    )  # fmt: skip


@pytest.mark.parametrize("wild", [1.0, 30.0])
def test_photos_through_one_lens_are_not_split(wild):
    """Also where photos differ by much more than their noise, as when boards bend."""
    rng = np.random.default_rng(11)
    chance = []
    for _ in range(30):
        photos = own_lenses(rng, int(rng.integers(5, 20)), wild)
        chance.append(best_split(photos).chance)
        if wild == 1:
            singles = [one.chance for one in unlike(photos)]
            assert min(singles) > BY_CHANCE
    # No more often than it says.
    assert np.mean(np.array(chance) < 0.1) <= 0.2
    assert min(chance) > 1e-4


def test_noisier_photos_are_not_odd():
    photos = own_lenses(np.random.default_rng(14))
    noisier = np.where(np.isin(np.arange(14), [2, 9, 11]), 5.0, 1.0)
    own, squares = photos.own * noisier[:, None], photos.squares * noisier**2
    dim = replace(photos, own=own, squares=squares)
    assert min(one.chance for one in unlike(dim)) > 1e-3


@pytest.mark.parametrize("kind", ["order", "mixed"])
def test_two_lenses_are_told_apart_with_their_photos(kind):
    rng = np.random.default_rng(12)
    photos = own_lenses(rng)
    second = np.arange(14) >= 9 if kind == "order" else np.isin(np.arange(14), [1, 4, 5, 11])
    own = photos.own.copy()
    own[second, :3] += [24.0, 6.0, -6.0]
    split = best_split(replace(photos, own=own))
    np.testing.assert_array_equal(split.second, second)
    assert split.chance < BY_CHANCE
    np.testing.assert_allclose(split.own[1] - split.own[0], [24, 6, -6], atol=3)


@pytest.mark.parametrize(
    ("differ", "chance", "along", "gain", "said"),
    [
        (6.0, 1e-4, 0.1, 0.5, True),
        (2.0, 1e-4, 0.1, 0.5, False),  # too little for the larger group to be so unsure
        (2.0, 1e-7, 0.1, 0.5, True),
        (0.9, 1e-7, 0.1, 0.5, False),  # no more than is stated
        (6.0, 1e-2, 0.1, 0.5, False),
        (6.0, 1e-7, -0.1, 0.5, False),  # as photos do that differ in one thing
        (6.0, 1e-7, 0.1, 0.05, False),  # photos that share their errors
    ],
)
def test_two_lenses_differ_by_more_than_is_stated_and_surely(differ, chance, along, gain, said):
    split = SimpleNamespace(chance=chance, along=along)
    second = np.arange(12) >= 9
    given = np.array([0.0, differ, 0.0])
    apart = SimpleNamespace(given=given, second=second, px=np.sqrt(1 - gain), split=split)
    assert two_lenses._are_two_lenses(apart, 1.0, 1.0) == said


@pytest.mark.parametrize("way", [(24.0, 6.0, -6.0), (0.0, 12.0, -9.0)])
def test_two_lenses_explain_nearly_all_on_the_way_from_one_to_the_other(way):
    """What photos differ by across it, or by one thing alone, is not of them."""
    rng = np.random.default_rng(18)
    photos = own_lenses(rng, wild=3.0)
    own = photos.own.copy()
    own[8:, :3] += way
    split = best_split(replace(photos, own=own))
    assert split.along > 0.05
    focus = photos.own.copy()
    focus[:, 0] += rng.normal(0, 30, 14)
    split = best_split(replace(photos, own=focus))
    assert split.chance < 1e-3
    assert split.along < 0


def test_a_few_of_many_photos_need_not_be_half_of_what_differs():
    """Groups of photos that differ in one thing are about as large: a small one is no such cut."""
    rng = np.random.default_rng(5)
    own = np.column_stack([rng.normal(0, 1, 400), np.zeros((400, 2))])
    weight = np.tile(np.eye(3), (400, 1, 1))
    for share in (0.1, 0.5):
        second = own[:, 0] > np.quantile(own[:, 0], 1 - share)
        along = two_lenses._explain_along(own, weight, second)
        assert along == pytest.approx(-1 / np.sqrt(400), abs=0.04)


def test_what_is_stated_of_a_camera_is_what_its_record_has():
    stated, nan = two_lenses._read_stated_px, np.nan
    assert stated(UncertaintyGrid(median_px=0.3, principal_point_px=(0.2, 0.4))) == 0.4
    assert stated(UncertaintyGrid(median_px=0.3, principal_point_px=(nan, 0.2))) == 0.3
    assert stated(UncertaintyGrid(median_px=nan, principal_point_px=(nan, nan))) == 0


def test_photos_are_put_to_the_lens_that_they_are_nearer_to():
    """A cut in the order of photos that take turns leaves some on the wrong side."""
    photos = own_lenses(np.random.default_rng(12))
    second = np.isin(np.arange(14), [3, 9, 10, 11, 12, 13])
    own = photos.own.copy()
    own[second, :3] += [24.0, 6.0, -6.0]
    photos = replace(photos, own=own)
    behind = np.arange(14) >= 9
    for start in (second, behind):
        np.testing.assert_array_equal(two_lenses._put_to_nearer_lens(photos, start), second)


def test_photos_that_know_their_lenses_along_different_axes_are_sorted():
    """Medians of the entries of what photos know need not be what any photo can know."""
    signs = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1]])
    photos = own_lenses(np.random.default_rng(16), 6)
    information = np.tile(np.eye(5), (6, 1, 1))
    for photo in range(6):
        xy, yz, xz = 0.9 * signs[photo // 2]
        information[photo, :3, :3] = [[1, xy, xz], [xy, 1, yz], [xz, yz, 1]]
    assert np.linalg.eigvalsh(information).min() > 0
    assert np.linalg.eigvalsh(np.median(information, axis=0)).min() < 0
    assert best_split(replace(photos, information=information)).second.any()


def test_too_few_photos_are_never_split():
    photos = own_lenses(np.random.default_rng(0), 4)
    assert best_split(photos) is None
    assert unlike(photos) == []


def test_what_a_photo_has_of_its_own_is_measured_beside_its_pose(pairs):
    middle = (np.array(pairs.image_size) - 1) / 2
    pixel = pairs.pixel.copy()
    scaled, sheared = pairs.image == 2, pairs.image == 5
    pixel[scaled] = middle + 1.01 * (pixel[scaled] - middle)
    pixel[sheared, 0] += 0.008 * (pixel[sheared, 1] - middle[1])
    found = photo_lenses.photo_lenses(
        FixedLens(camera=LENS), as_poses(POSES), replace(pairs, pixel=pixel)
    )
    np.testing.assert_array_equal(found.photos, np.arange(8))
    assert found.own[2, 0] == pytest.approx(0.01 * found.half_side, rel=0.15)
    assert found.own[5, 3] == pytest.approx(0.008 * found.half_side, rel=0.15)
    assert [one.photo for one in unlike(found) if one.chance < BY_CHANCE] == [2, 5]
    # What a wrong pose leaves is no noise.
    poses = as_poses(POSES)
    tilted = Rotation.from_rotvec([0.001, 0.001, 0]).as_matrix() @ poses.rotation
    off = photo_lenses.photo_lenses(FixedLens(camera=LENS), replace(poses, rotation=tilted), pairs)
    assert off.squares / off.numbers == pytest.approx(np.full(8, 0.01), rel=0.5)
    few = select(pairs, (pairs.image != 1) | (np.cumsum(pairs.image == 1) <= 10))[0]
    found = photo_lenses.photo_lenses(FixedLens(camera=LENS), as_poses(POSES), few)
    assert 1 not in found.photos


CENTRE = np.array([500.0, 350.0])


@pytest.mark.parametrize(
    ("ratio", "shift", "cause", "words"),
    [
        (1.05, (0.5, 0.2), "zoom", "focal length differs by +5 %"),
        (1.0, (9.0, -4.0), "shifted", "centre is off by (+9.0, -4.0) px"),
        (0.5, -0.5 * (CENTRE + 0.5), "scaled", "scaled by 0.5"),
        (1.0005, np.array([960, 720]) - 1 - 2 * CENTRE, "turned", "turned by 180°"),
        (1.1, (40.0, -30.0), "two_lenses", "two cameras"),
    ],
)
def test_how_a_lens_differs_is_named(exact, ratio, shift, cause, words):
    reported = [
        lens_change(
            ratio,
            np.array(shift, float),
            CENTRE,
            ["a.png", "b.png"],
            ["c.png", "d.png"],
            exact,
            in_order=in_order,
            because="",
            figures={},
        )
        for in_order in (True, False)
    ]
    assert [one.code for one in reported] == [cause] * 2
    assert all(words in render(one).what for one in reported)
    assert "from a.png on" in render(reported[0]).what
    assert "in a.png and b.png, compared with c.png and d.png" in render(reported[1]).what
    assert ("bumped or moved" in render(reported[0]).what) == (cause == "shifted")
    # Two cameras of one make differ like this too, and their photos come one after the other.
    assert cause in ("turned", "scaled") or all("camera" in render(one).what for one in reported)


def test_photos_that_were_left_out_show_their_own_lens(pairs):
    zoomed = replace(LENS, fx=1.3 * LENS.fx, fy=1.3 * LENS.fy)
    others = synthetic.synthetic_correspondences(TARGET, POSES, lens=zoomed, noise=0.1, seed=7)
    names = [f"{number}.png" for number in range(8)]
    found = left_out_lens(LENS, replace(others, images=tuple(names)), 0.1, order=["x", *names])
    assert (found.code, found.images) == ("zoom", tuple(names))
    assert "+30 % from 0.png on" in render(found).what
    assert left_out_lens(LENS, pairs, 0.1, order=["x", *pairs.images]) is None
    # A few photos that were left out say nothing against the camera of the others.
    many = [f"more {number}" for number in range(30)]
    few = left_out_lens(LENS, replace(others, images=tuple(names)), 0.1, order=[*many, *names])
    assert (found.severity, few.severity) == ("bad", "care")


def test_one_photo_of_a_flat_board_has_no_lens_of_its_own(monkeypatch):
    target = synthetic.flat_board()
    poses = synthetic.poses_around(target, 4, seed=3)
    zoomed = replace(LENS, fx=1.3 * LENS.fx, fy=1.3 * LENS.fy)
    seen = synthetic.synthetic_correspondences(target, poses, lens=zoomed, noise=0.1, seed=7)
    order = ["x", *seen.images]
    assert left_out_lens(LENS, seen, 0.1, order=order) is not None
    monkeypatch.setattr(rejected_photos, "_SURE_FOCAL", np.inf)
    for photos in ([0], [1, 2]):
        some = select_photos(seen, np.array(photos))
        assert left_out_lens(LENS, some, 0.1, order=order) is None


@pytest.mark.parametrize("ratio", [1.004, 0.99996, 1 + 1e-12, 0.5, 2.0, 1.25])
def test_a_ratio_is_never_printed_as_1(ratio):
    words = two_lenses._write_ratio(ratio)
    assert float(words) == pytest.approx(ratio, rel=0.05 * abs(ratio - 1) + 1e-8)
    assert float(words) != 1 or abs(ratio - 1) < 1e-9


# What changes from photo to photo


def unsteady_pairs(change, size=None, *, seed=31, target=None):
    """Photos of a target of which something is another in each, and the target.

    Boards bend by so many millimetres, the focal length changes by such a share, or the centre is
    shifted by so many pixels: standard deviations.
    """
    target = target or synthetic.flat_board()
    size = size or {"bend": 1.5, "scale": 0.02, "shift": 8.0, "none": 0.0}[change]
    rng = np.random.default_rng(seed)
    poses = synthetic.poses_around(target, 14, seed=seed)
    parts = []
    for pose in poses:
        bent = {}
        for number, board in enumerate(target.boards):
            shape = BoardShape(
                bend=rng.normal(0, size, 2) if change == "bend" else np.zeros(2),
                twist=0.0, stretch=np.zeros(2),
                offsets=np.zeros((board.rows, board.columns, 3)),
            )  # fmt: skip
            bent[number] = replace(board, shape=shape)
        real = target.with_boards(bent)
        lens = LENS
        if change == "scale":
            ratio = rng.normal(1, size)
            lens = replace(LENS, fx=ratio * LENS.fx, fy=ratio * LENS.fy)
        if change == "shift":
            shift = rng.normal(0, size, 2)
            lens = replace(LENS, cx=LENS.cx + shift[0], cy=LENS.cy + shift[1])
        parts.append(
            synthetic.synthetic_correspondences(
                real, [pose], lens=lens, noise=0.1, seed=int(rng.integers(1000))
            )
        )
    board, column, row = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("board", "column", "row")
    )
    whole = replace(
        parts[0],
        images=tuple(f"{number:02d}.png" for number in range(len(parts))),
        image=np.repeat(np.arange(len(parts)), [len(part.pixel) for part in parts]),
        pixel=np.concatenate([part.pixel for part in parts]),
        weight=np.ones(len(board)),
        board=board, column=column, row=row,
        world=target.world_points(board, column, row),
    )  # fmt: skip
    return whole, target


ANEW = {"bend": Code.BENT, "scale": Code.ZOOM, "shift": Code.SHIFTED}


@pytest.mark.slow
@pytest.mark.parametrize("change", ["bend", "scale", "shift"])
def test_what_changes_from_photo_to_photo_accuses_no_single_ones(change):
    seen, target = unsteady_pairs(change)
    found = calibrate(seen, target=target, refine_target="off", hold_out=False).findings
    assert [(one.code, one.case) for one in found] == [(ANEW[change], "anew")]


@pytest.mark.slow
@pytest.mark.parametrize("target", [synthetic.flat_board(), synthetic.corner_of_three()])
@pytest.mark.parametrize(("change", "size"), [("bend", 6.0), ("scale", 0.08), ("shift", 15.0)])
@pytest.mark.parametrize("seed", [7, 31])
def test_what_changes_much_is_named_or_accuses_nobody(change, size, seed, target):
    """Also where the target was refined, which takes up a part of it."""
    seen, target = unsteady_pairs(change, size, seed=seed, target=target)
    made = calibrate(seen, target=target, refine_target="auto", hold_out=False)
    accused = [(one.code, one.case) for one in made.findings if one.images]  # boards are doubted
    # On three boards a row's shift is nearly one of the centre.
    assert accused in ([(ANEW[change], "anew")], [] if change == "shift" else None)
    assert Code.LARGE_ERRORS in [one.code for one in made.verdict.reasons]


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 0.003])
def test_odd_photos_are_compared_with_a_lens_that_knows_none_of_them(size):
    """Three of them hide each other beside a lens and poses that were fitted to all."""
    number = next(i for i, case in enumerate(wrong.CASES) if "sheared by 0.3 %" in case.name)
    corners = wrong.sheared(np.random.default_rng([number, 2]), size).corners
    found = calibrate(corners.with_target(TARGET), hold_out=False).findings
    assert [one.images for one in found] == [("03.png", "08.png", "09.png")] * (size > 0)


def through(focal, farthest_deg, count, seed):
    """Corners of one flat board in photos of a camera of its own."""
    lens = AsymmetricLens(
        image_size=(640, 480), fx=focal, fy=focal, cx=325.0, cy=236.0, max_angle_deg=farthest_deg
    )
    return simulated_corners(lens, NINE_BY_SIX, count, seed=seed, errors=CornerErrors(noise=0.07))[
        0
    ]


@pytest.mark.slow
@pytest.mark.parametrize("order", ["wide first", "narrow first", "mixed", "mixed otherwise"])
@pytest.mark.parametrize("count", [6, 10])
def test_two_cameras_that_are_far_apart_are_named(count, order):
    """Beside a fit that one camera has bent to both, a step to the other overshoots by far."""
    cameras = through(335.0, 60.0, count, 0), through(535.0, 40.0, count, 50)
    names = np.array([f"{number:02d}.png" for number in range(2 * count)])
    if order.startswith("mixed"):
        names = names[np.random.default_rng(len(order)).permutation(2 * count)]
    if order == "narrow first":
        names = names[::-1]
    wide, narrow = (
        replace(seen, images=tuple(names[part].tolist()))
        for seen, part in zip(cameras, (slice(count), slice(count, None)), strict=True)
    )
    both = Observations.joined([wide, narrow])
    pairs = Observations.joined([select_photos(both, np.array([k])) for k in np.argsort(names)])
    (found,) = calibrate(pairs, NINE_BY_SIX, hold_out=False).findings
    assert found.code in (Code.ZOOM, Code.TWO_LENSES)
    assert json.loads(json.dumps(found.as_record()))["figures"] == found.figures
    assert found.severity is Severity.BAD
    truth = 535 / 335
    if set(found.images) == set(wide.images):
        truth = 1 / truth
    else:
        assert set(found.images) == set(narrow.images)
    assert found.figures["focal_off"] == pytest.approx(truth - 1, abs=0.12 * truth)


@pytest.mark.slow
def test_a_few_photos_of_another_camera_make_a_bad_one():
    """Poses of a flat board hide how far its centre is off: its corners are off by much less."""
    lens = AsymmetricLens(
        image_size=(640, 480), fx=335.0, fy=335.0, cx=325.0, cy=236.0, max_angle_deg=60.0
    )
    twin = replace(lens, cx=lens.cx + 0.4, cy=lens.cy - 7.1)
    names = [f"{number:02d}.png" for number in range(14)]
    few = ("01.png", "04.png", "08.png", "11.png")
    parts = []
    for camera, own, first in (
        (lens, tuple(name for name in names if name not in few), 0),
        (twin, few, 50),
    ):
        errors = CornerErrors(noise=0.15)
        seen, _ = simulated_corners(camera, NINE_BY_SIX, len(own), seed=first, errors=errors)
        parts.append(replace(seen, images=own))
    both = Observations.joined(parts)
    order = np.argsort(both.images)
    made = calibrate(
        Observations.joined([select_photos(both, np.array([photo])) for photo in order]),
        NINE_BY_SIX,
    )
    assert made.held_out.rms_px < 0.35
    (found,) = made.findings
    assert (found.code, made.verdict.level) == (Code.SHIFTED, "bad")
    assert set(few) <= set(found.images)
    assert render(made.verdict.reasons[0]).what == render(found).what
    assert not found.figures["in_order"]
    assert sorted([*found.images, *found.figures["rest"]]) == names


@pytest.mark.slow
@pytest.mark.parametrize(("few", "count"), [(4, 14), (3, 20), (7, 14)])
@pytest.mark.parametrize(("name", "seed"), [("moving-pupil", 1), ("equisolid", 2)])
def test_photos_of_a_camera_of_the_same_kind_are_never_in_a_good_one(name, seed, few, count):
    """Two cameras with lenses that the model cannot follow, whose photos take turns."""
    rng = np.random.default_rng([seed, few, count])
    lens = synthetic_lens(name)
    way = rng.uniform(-np.pi, np.pi)
    centre = np.array(lens.centre) + 5 * np.array([np.cos(way), np.sin(way)])
    twin = replace(lens, focal=tuple(1.003 * np.array(lens.focal)), centre=tuple(centre))
    names = np.array([f"{number:02d}.png" for number in range(count)])
    odd = np.isin(names, names[:: count // few][:few])
    cameras = []
    for camera, own, first in ((lens, ~odd, seed), (twin, odd, seed + 50)):
        seen, _ = simulated_corners(camera, NINE_BY_SIX, int(own.sum()), seed=first)
        cameras.append(replace(seen, images=tuple(names[own].tolist())))
    both = Observations.joined(cameras)
    order = np.argsort(both.images)
    made = calibrate(
        Observations.joined([select_photos(both, np.array([photo])) for photo in order]),
        NINE_BY_SIX,
    )
    found, left_out = made.verdict.reasons[0], set(made.unfit)
    if left_out:  # two of twenty hardly make a wrong camera
        assert found.code in (Code.PHOTO_LENS, Code.SHIFTED, Code.TWO_LENSES)
        assert set(found.images) == set(names[odd].tolist()) - left_out
        return
    assert made.verdict.level == "bad"
    assert found.code in (Code.SHIFTED, Code.TWO_LENSES)
    assert "two cameras" in render(found).what
    # The photos of each, whichever is told of: where they are as many, nobody knows whose they are.
    groups = [set(found.images), set(found.figures["rest"])]
    true = [set(names[own].tolist()) for own in (odd, ~odd)]
    assert groups in (true, true[::-1])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [101, 107])
def test_what_a_photo_cannot_tell_from_its_pose_makes_it_no_odd_one(seed):
    """A flat board in a lens near a pinhole: hundreds of pixels of scale or shear fit as well."""
    tangent = (1 / 3, 2 / 15, 17 / 315, 62 / 2835)
    lens = AsymmetricLens(
        image_size=(960, 720), fx=400.0, fy=400.0, cx=480.0, cy=360.0, k=tangent, max_angle_deg=55.0
    )
    errors = CornerErrors(noise=0.1, shared=0, spread=0)
    seen, _ = simulated_corners(lens, NINE_BY_SIX, 12, seed=seed, errors=errors)
    made = calibrate(seen, NINE_BY_SIX, hold_out=False)
    assert Code.PHOTO_LENS not in {one.code for one in made.findings}


@pytest.mark.parametrize(("odd", "severity"), [([2], "note"), ([2, 5], "care")])
def test_one_odd_photo_is_no_reason_to_doubt_a_camera(fitted, monkeypatch, odd, severity):
    fit = SimpleNamespace(reference=SimpleNamespace(pairs=fitted.pairs))
    reported = [Unlike(photo=photo, chance=1e-9, share=0.6, gain_px=0.4 + photo) for photo in odd]
    for name, answer in (("unlike", reported), ("lenses_of", None), ("_refit_without", None)):
        monkeypatch.setattr(photo_lenses, name, lambda *_, answer=answer: answer)
    monkeypatch.setattr(photo_lenses, "_can_do_without", lambda *_: True)
    (found,) = photo_lenses.odd_photos(SimpleNamespace(fit=fit))
    assert (found.code, found.severity) == (Code.PHOTO_LENS, severity)
    assert found.images == tuple(fitted.pairs.images[photo] for photo in odd)
    assert found.figures["worst"] == found.images[-1]
    # Without the others nobody can say so.
    monkeypatch.setattr(photo_lenses, "_can_do_without", lambda *_: False)
    assert photo_lenses.odd_photos(SimpleNamespace(fit=fit)) == []


def test_photos_that_all_differ_accuse_none_of_them():
    """Each has a lens of its own by what its sheet bends, far beyond its corners' noise."""
    count, least = 8, 1.0
    for seed in range(300):
        own = np.random.default_rng(seed).normal(size=(count, 5))
        photos = photo_lenses.PhotoLenses(
            photos=np.arange(count),
            own=own,
            information=np.tile(1e3 * np.eye(5), (count, 1, 1)),
            squares=np.full(count, 200.0),
            numbers=np.full(count, 200.0),
            half_side=300.0,
        )
        least = min(least, *(one.chance for one in unlike(photos)))
    assert photo_lenses.BY_CHANCE < least < 0.05
    # One that is another camera's is still found.
    odd = replace(photos, own=own + 400 * (np.arange(count) == 7)[:, None])
    found = unlike(odd)[7]
    assert found.chance < photo_lenses.BY_CHANCE
    # What is its own takes sqrt(5 · 400² · 1e3 / 100) px from its corners.
    assert found.gain_px == pytest.approx(np.sqrt(5 * 400**2 * 1e3 / 100), rel=0.1)


# Many photos


@pytest.fixture(scope="module")
def many():
    """Forty photos through one lens, of which each shows some of the corners."""
    poses = synthetic.poses_around(TARGET, 40, seed=9)
    every = synthetic.synthetic_correspondences(TARGET, poses, lens=LENS, noise=0.1, seed=6)
    return select(every, np.random.default_rng(0).random(len(every.pixel)) < 0.3)[0]


def zoomed_from(pairs, photo, ratio):
    middle = (np.array(pairs.image_size) - 1) / 2
    pixel = np.where(
        (pairs.image >= photo)[:, None], middle + ratio * (pairs.pixel - middle), pairs.pixel
    )
    return replace(pairs, pixel=pixel)


@pytest.mark.slow
def test_two_lenses_among_many_photos_are_named_with_all_of_them(many):
    found = calibrate(zoomed_from(many, 25, 1.02), hold_out=False).findings
    assert [one.code for one in found] == ["zoom"]
    assert found[0].images == many.images[25:]
    assert "+2 % from 25.png on" in render(found[0]).what


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 1.002])
def test_many_right_photos_are_not_followed_up(many, monkeypatch, ratio):
    """A change of no worth is certain among so many photos, and costs nothing."""
    monkeypatch.setattr(two_lenses, "_fit_apart", lambda *_: pytest.fail("must not be tried"))
    assert not calibrate(zoomed_from(many, 20, ratio), hold_out=False).findings


@pytest.mark.slow
def test_a_wrong_square_among_many_photos_is_measured_with_all_of_them(many, monkeypatch):
    drawn = wrong.with_board(TARGET, 1, square=36.36)
    world = drawn.world_points(many.board, many.column, many.row)
    used = []
    refine = wrong_nominal.refine_object

    def counted(fit, *rest):
        used.append(len(fit.poses))
        return refine(fit, *rest)

    monkeypatch.setattr(wrong_nominal, "refine_object", counted)
    found = calibrate(replace(many, world=world), target=drawn, refine_target="off",
                      hold_out=False).findings  # fmt: skip
    assert [one.code for one in found] == ["board_square"]
    assert "board wall are off by -0.99 %" in render(found[0]).what
    assert used == [40]


# One photo that does not fit


def one_photo(changed=lambda corners: {}):
    """Pairs of one photo with some columns of its corners changed."""
    corners = synthetic.synthetic_corners(TARGET, POSES[:1], lens=LENS, noise=0.1, seed=8)
    corners = replace(corners, **changed(corners))
    sizes = np.array([(board.columns, board.rows) for board in TARGET.boards])[corners.board]
    named = np.stack([corners.column, corners.row], axis=-1)
    return wrong.only(corners, ((named >= 0) & (named < sizes)).all(1)).with_target(TARGET)


@pytest.mark.parametrize(
    ("changed", "cause", "words"),
    [
        (
            lambda c: {"column": c.column + (c.board == 0)},
            "corner_names",
            "board floor are misnamed: 1 column too far",
        ),
        (
            lambda c: {"row": c.row - 2 * (c.board == 1)},
            "corner_names",
            "board wall are misnamed: 2 rows too near",
        ),
        (
            lambda c: {"column": np.where(c.board == 2, 6 - c.column, c.column)},
            "corner_names",
            "board side are misnamed: columns counted backwards",
        ),
        (
            lambda c: {"column": c.column + 1, "row": c.row + 1},
            "corner_names",
            "all boards are misnamed: 1 column too far and 1 row too far",
        ),
        (
            lambda c: {"pixel": c.pixel + (c.board[:, None] == 1) * [6, -5]},
            "board_place",
            "board wall is not where it is in the other photos",
        ),
    ],
)
def test_the_board_that_spoils_a_photo_is_named(changed, cause, words):
    fault = board_fault(LENS, one_photo(changed), TARGET, 1.0, 0.1)
    (found,) = board_findings([fault], lambda board, times: False)
    assert (found.code, found.severity) == (cause, "note")
    assert words in render(found).what
    assert found.images == ("00.png",)


def test_corners_under_another_boards_name():
    pairs = one_photo()
    pairs, _ = select(pairs, pairs.board != 1)
    board = np.where(pairs.board == 2, 1, pairs.board)
    world = TARGET.world_points(board, pairs.column, pairs.row)
    fault = board_fault(LENS, replace(pairs, board=board, world=world), TARGET, 1.0, 0.1)
    (found,) = board_findings([fault], lambda board, times: False)
    assert (found.code, found.boards) == ("corner_names", ("wall",))
    assert "they belong to board side" in render(found).what


@pytest.mark.parametrize(
    ("changed", "cause", "of_photos", "of_nominal"),
    [
        (
            lambda c: {"column": np.where(c.board == 2, 6 - c.column, c.column)},
            "board_order",
            "00.png, 01.png and 02.png: corners of board side are misnamed: columns counted",
            "board side: columns are counted the other way round",
        ),
        (
            lambda c: {"pixel": c.pixel + (c.board[:, None] == 1) * [6, -5]},
            "board_place",
            "00.png, 01.png and 02.png: board wall is not where it is in the other photos",
            "board wall is not where target.yaml puts it",
        ),
    ],
)
def test_photos_with_the_same_fault_are_reported_together(changed, cause, of_photos, of_nominal):
    fault = board_fault(LENS, one_photo(changed), TARGET, 1.0, 0.1)
    other = board_fault(
        LENS, one_photo(lambda c: {"column": c.column + (c.board == 0)}), TARGET, 1.0, 0.1
    )
    faults = [replace(fault, images=(f"0{number}.png",)) for number in range(3)]
    options = []

    def is_usual(board, times):
        options.append((board, times))
        return times == 3

    found, single = board_findings([*faults, other], lambda board, times: False)
    assert of_photos in render(found).what
    assert (found.severity, found.images) == ("note", ("00.png", "01.png", "02.png"))
    assert "1 column too far" in render(single).what
    found, single = board_findings([*faults, other], is_usual)
    assert options == [(*fault.boards, 3), ("floor", 1)]
    assert of_nominal in render(found).what
    assert (found.severity, found.code, found.boards) == ("care", cause, fault.boards)
    assert single.severity == "note"


def test_nothing_is_said_of_a_photo_that_no_board_explains():
    pairs = one_photo()
    pixel = pairs.pixel + np.random.default_rng(0).normal(0, 5, pairs.pixel.shape)
    assert board_fault(LENS, replace(pairs, pixel=pixel), TARGET, 1.0, 0.1) is None


@pytest.mark.slow
def test_a_blurred_photo_has_no_board_that_moved():
    """A few corners of one board are fitted by a pose whatever they are."""
    pairs = one_photo()
    few, _ = select(pairs, (pairs.board != 0) | (pairs.column < 2) & (pairs.row < 4))
    few, _ = select(few, few.board != 1)
    for seed in range(5):
        pixel = few.pixel + np.random.default_rng(seed).normal(0, 0.9, few.pixel.shape)
        assert board_fault(LENS, replace(few, pixel=pixel), TARGET, 1.0, 0.1) is None


# Where there is no fit


@pytest.mark.slow
def test_corners_that_do_not_fit_are_explained_by_what_is_likeliest(pairs):
    def failure(pairs, fits=False):
        return FailedFit(pairs=pairs, target=TARGET, fits=fits)

    known = Finding(code=Code.MIRRORED, case="target", severity=Severity.BAD)
    note = Finding(code=Code.MIRRORED, case="colours_in_mirror")
    assert find_faults(failure(pairs), [note, known]) == [known]
    # Boards that have other counts make a camera, or none.
    counted = Finding(code=Code.CORNER_COUNT, case="squares", severity=Severity.CARE)
    assert find_faults(failure(pairs), [note, counted]) == [counted]
    half = mirrored(pairs, pairs.image < 3)
    assert [one.images for one in find_faults(failure(half))] == [("00.png", "01.png", "02.png")]
    # What fits is not explained away: a right set-up that failed for another reason.
    assert find_faults(failure(pairs, fits=True)) == []
    assert find_faults(failure(select_photos(pairs, np.arange(4)))) == []
    assert find_faults(failure(select_photos(pairs, np.array([0])))) == []


@pytest.fixture(scope="module")
def points(pairs):
    """The same corners as points with no board, rows and columns."""
    return replace(pairs, board=np.full(len(pairs.board), -1), boards=(), target=None)


@pytest.mark.slow
def test_points_that_fit_in_a_mirror_are_reported(points):
    points = select_photos(points, np.arange(4))
    with raises_told(FitError, match=r"all photos are mirrored, or the points' coordinates"):
        calibrate(mirrored(points, slice(None)))
    with pytest.raises(FitError):
        mirrored_object(FailedFit(pairs=points, target=None))


@pytest.mark.slow
def test_points_that_are_paired_at_random_are_refused_quickly(points, monkeypatch):
    iterations = []
    adjust = radial_reference.adjust

    def counted(*arguments, **options):
        fit = adjust(*arguments, **options)
        iterations.append(fit.iterations)
        return fit

    monkeypatch.setattr(radial_reference, "adjust", counted)
    rng = np.random.default_rng(0)
    with pytest.raises(FitError, match=r"typical error \d+ px\): check the target's square sizes"):
        calibrate(replace(points, pixel=rng.permutation(points.pixel)))
    # No centre of the lens and no choice of photos is worth more than a quick try.
    assert len(iterations) < 50
    assert set(iterations) == {1}


def test_a_flat_object_is_the_same_in_a_mirror():
    flat = synthetic.flat_board()
    poses = synthetic.poses_around(flat, 5, seed=1)
    pairs = synthetic.synthetic_correspondences(flat, poses, lens=LENS, noise=0.1)
    assert mirrored_object(FailedFit(pairs=mirrored(pairs, slice(None)), target=None)) == []


@pytest.mark.slow
def test_photos_that_do_not_go_with_the_others_are_named(points):
    """An object that moved between photos: no lens explains them."""
    rng = np.random.default_rng(3)
    world = points.world / world_scale(points)
    moved = np.isin(points.image, [1, 6])
    world[moved] = rng.permutation(world[moved])
    (found,) = failed_lens(FailedFit(pairs=replace(points, world=world), target=None))
    assert (found.code, found.images) == ("photo_lens", ("01.png", "06.png"))
    assert render(found).what.startswith("01.png and 06.png do not match the other 6 photos")


def test_few_of_many_photos_are_tried():
    assert len(list(rejected_photos._list_subsets(1000))) < 40
    assert max(len(few) for few in rejected_photos._list_subsets(1000)) <= 6


@pytest.mark.slow
def test_photos_that_only_say_too_little_are_not_taken_apart(pairs, monkeypatch):
    """One board, always square to the camera: nothing is wrong with the drawing or the lens."""
    flat = synthetic.flat_board()
    rng = np.random.default_rng(0)
    poses = [
        (np.array([0, 0, turn]), np.array([*rng.normal(0, 30, 2), rng.uniform(300, 500)]))
        for turn in rng.uniform(-3, 3, 8)
    ]
    facing = synthetic.synthetic_correspondences(flat, poses, lens=LENS, noise=0.1)
    monkeypatch.setattr(
        rejected_photos, "failed_lens", lambda pairs: pytest.fail("must not be tried")
    )
    with pytest.raises(FitError, match=r"do not determine the lens.*: add photos in which"):
        calibrate(facing, target=flat, hold_out=False)
