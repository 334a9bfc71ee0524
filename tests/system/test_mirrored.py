"""Photos that a mirror shows: named and fitted where the target says so, and told where not."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import yaml
from anonymous_grids import anonymous_photos
from scipy.spatial.transform import Rotation
from seen import grid_evidence
from synthetic import IMAGE_SIZE, checkerboard, corner_of_three

from cubicfish import Target, TargetError
from cubicfish.diagnosis.object_faults import find_wrong_layout
from cubicfish.find import find_grids
from cubicfish.find.detection.grids import grid_in_mirror
from cubicfish.find.detection.markers import find_marked_corners
from cubicfish.find.identification.identified import Decided
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.fit.radial_reference import fit_radial
from cubicfish.observe.detection import first_pass
from cubicfish.photos import find_photos
from cubicfish.scene.faces import board_face
from cubicfish.solve.statistics import rms_px
from cubicfish.target.boards.shape import BoardShape
from cubicfish.workers.pool import Work
from cubicfish_cli.words.sentences import render
from tests.cubicfish.find.detection.test_markers import MIXED, POSE, errors, mixed_photo, photo_of
from tests.cubicfish.find.identification.test_name_grids import names, seen

DATA = {
    "units": "mm",
    "boards": [
        {
            "name": "b", "type": "checkerboard", "corners": [7, 5], "square": 30,
            "origin": [10, 20, 30], "x_axis": [0, 0, 1], "y_axis": [0, 1, 0], "twist": 0.5,
            "bend": [1, 2], "offsets": [[1, 2, 0.1, 0.2, 0.3]],
        },
        {"name": "p", "type": "points", "points": [[0, 0, 0], [1, 2, 3]]},
    ],
}  # fmt: skip


def mirrored_photos(target, photos=6):
    """Grids as they are found in mirrored photos, and their corners' true names by pixel."""
    corners = seen(target, photos=photos)
    grids, _ = anonymous_photos(corners, target)
    width = IMAGE_SIZE[0]
    names_of = {
        (int(image), *np.round([width - 1 - x, y], 6)): (int(board), int(column), int(row))
        for image, board, column, row, (x, y) in zip(
            corners.image, corners.board, corners.column, corners.row, corners.pixel, strict=True
        )
    }
    return [[grid_in_mirror(grid, width) for grid in own] for own in grids], names_of


@pytest.mark.slow
def test_a_mirrored_object_is_named_and_fitted_as_the_mirror_shows_it():
    target = Target.from_data({"mirrored": True, **yaml.safe_load(corner_of_three().text())})
    grids, names_of = mirrored_photos(target.as_printed())
    identified = name_grids(grids, target, IMAGE_SIZE, names(len(grids)))
    corners = identified.corners
    assert len(corners.pixel) == sum(len(grid) for own in grids for grid in own)
    for image, board, column, row, pixel in zip(
        corners.image, corners.board, corners.column, corners.row, corners.pixel, strict=True
    ):
        true = names_of[(int(image), *np.round(pixel, 6))]
        assert (board, target.boards[board].columns - 1 - column, row) == true
    fit = fit_radial(corners.with_target(target))
    assert rms_px(fit.residual) < 0.3


@pytest.mark.slow
def test_a_mirrored_object_is_told_what_to_say():
    target = corner_of_three()
    grids, _ = mirrored_photos(target)
    identified = name_grids(grids, target, IMAGE_SIZE, names(len(grids)))
    (finding,) = find_wrong_layout(grid_evidence(identified, target))
    assert render(finding).what == "all photos are mirrored"
    assert "mirrored: true at the top of target.yaml" in render(finding).do


@pytest.mark.slow
def test_an_object_that_is_not_mirrored_is_reported_to_be_so():
    target = corner_of_three()
    grids, _ = anonymous_photos(seen(target, photos=6), target)
    shown = target.in_mirror()
    identified = name_grids(grids, shown, IMAGE_SIZE, names(len(grids)))
    (finding,) = find_wrong_layout(grid_evidence(identified, shown))
    assert render(finding).what == "no photo is mirrored"
    assert render(finding).do == "remove mirrored: true from target.yaml"


@pytest.mark.parametrize(
    ("said", "mirrored", "shown", "reported"),
    [
        ("dark", False, "light", "set first_square: light"),
        ("light", False, "dark", "set first_square: dark"),
        ("dark", True, "dark", "set first_square: light"),
    ],
)
def test_the_note_about_colours_says_what_to_write(tmp_path, said, mirrored, shown, reported):
    """A photo that is not mirrored: of a board of 7x5 corners, straight on."""
    first = 0 if shown == "dark" else 1
    squares = ((np.add(*np.indices((6, 8))) + first) % 2 * 200 + 30).astype(np.uint8)
    photo = np.full((720, 960), 230, np.uint8)
    photo[180:540, 210:690] = np.kron(squares, np.ones((60, 60), np.uint8))
    cv2.imwrite(str(tmp_path / "0.png"), cv2.GaussianBlur(photo, (0, 0), 0.7))
    board = {"name": "b", "type": "checkerboard", "corners": [7, 5], "square": 30}
    target = Target.from_data(
        {"units": "mm", "mirrored": mirrored, "boards": [{**board, "first_square": said}]}
    )
    detection = first_pass(find_photos([tmp_path]), [target], Work())
    assert len(detection.corners.pixel) == 35
    (finding,) = detection.findings
    assert finding.severity == "note"
    assert render(finding).do.startswith(reported)
    assert ("remove mirrored: true" in render(finding).do) == mirrored
    assert f"first_square is not {said}" in render(finding).what


@pytest.mark.slow
def test_a_first_square_of_the_other_colour_is_told_by_its_key():
    target = corner_of_three()
    grids, _ = anonymous_photos(seen(target, photos=6), target)
    wrong = replace(target.boards[0], first_square="light")
    assert target.boards[0].first_square == "dark"
    target = target.with_boards({0: wrong})
    (finding,) = find_wrong_layout(
        grid_evidence(name_grids(grids, target, IMAGE_SIZE, names(6)), target)
    )
    assert "first_square: dark" in render(finding).what


@cache
def lone_board(columns, rows):
    """A target, and its grids in three photos that show all of it."""
    target = Target(units="mm", boards=(checkerboard("b", columns, rows, 30.0),))
    grids, _ = anonymous_photos(seen(target, photos=6, distance=(0.8, 1.4)), target)
    return target, [own for own in grids if len(own[0]) == columns * rows][:3]


@pytest.mark.parametrize("size", [(7, 5), (6, 4), (8, 8)])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("first", ["dark", "light"])
def test_a_lone_board_is_named_in_either_colour_and_mirrored(size, mirrored, first):
    target, whole = lone_board(*size)
    assert len(whole) == 3
    if mirrored:
        whole = [[grid_in_mirror(own[0], IMAGE_SIZE[0])] for own in whole]
    said = target.with_boards({0: replace(target.boards[0], first_square=first)})
    identified = name_grids(whole, said, IMAGE_SIZE, names(len(whole)))
    assert [own[0].verdict for own in identified.grids] == [Decided.NAMED] * len(whole)
    # A mirror exchanges the colours where both numbers of corners are odd.
    assert identified.other_colours == ((first == "light") != (mirrored and size == (7, 5)))


def test_one_photo_of_other_colours_is_left_out_and_says_so():
    target, (first, *others) = lone_board(7, 5)
    whole = [[grid_in_mirror(first[0], IMAGE_SIZE[0])], *others]
    identified = name_grids(whole, target, IMAGE_SIZE, names(len(whole)))
    assert not identified.other_colours
    assert [own[0].verdict for own in identified.grids] == [Decided.COLOURS] + [Decided.NAMED] * (
        len(whole) - 1
    )


def test_the_file_says_what_it_said():
    printed = Target.from_data(DATA)
    target = Target.from_data({**DATA, "mirrored": True})
    assert target.mirrored
    assert not printed.mirrored
    assert yaml.safe_load(target.text()) == {
        "mirrored": True,
        **yaml.safe_load(printed.text()),
    }
    again = Target.from_data(yaml.safe_load(target.text()))
    np.testing.assert_allclose(again.corners()[3], target.corners()[3])


def test_a_mirror_shows_every_corner_where_it_is():
    printed, shown = Target.from_data(DATA), Target.from_data({**DATA, "mirrored": True})
    column, row = (part.ravel() for part in np.indices((7, 5)))
    in_plane = shown.boards[0].world_points(6 - column, row) * [1, 1, -1]
    np.testing.assert_allclose(in_plane, printed.boards[0].world_points(column, row))
    points = shown.boards[1].world_points([0, 1], [0, 0]) * [1, 1, -1]
    np.testing.assert_allclose(points, printed.boards[1].world_points([0, 1], [0, 0]))
    assert isinstance(shown.boards[0].shape, BoardShape)


@pytest.mark.parametrize("value", ["yes please", 1, None])
def test_mirrored_is_true_or_false(value):
    with pytest.raises(TargetError, match="mirrored: must be true or false"):
        Target.from_data({**DATA, "mirrored": value})


def test_the_printed_face_is_the_mirrors_turned_round():
    board = MIXED.boards[0]
    shown = board.in_mirror()
    rng = np.random.default_rng(0)
    width = board.plane_points(board.columns - 1, 0)[0]
    plane = rng.uniform(-board.square, width + board.square, (400, 2))
    flipped = np.stack([width - plane[:, 0], plane[:, 1]], axis=-1)
    drawn, seen_so = board_face(board, margin=1.0), board_face(shown, margin=1.0)
    np.testing.assert_array_equal(drawn.is_dark(plane), seen_so.is_dark(flipped))
    assert 0.2 < drawn.is_dark(plane).mean() < 0.8
    cells, own = board.marker_cells(), shown.marker_cells()
    np.testing.assert_array_equal(own[:, 0], cells[:, 0])
    np.testing.assert_array_equal(own[:, 1], board.columns - cells[:, 1])


@pytest.mark.slow
def test_markers_are_read_in_mirrored_photos():
    photo = mixed_photo()
    mirrored = np.ascontiguousarray(photo[:, ::-1])
    plain = find_marked_corners(photo, MIXED, find_grids(photo))
    shown = MIXED.in_mirror()
    found = find_marked_corners(mirrored, shown, find_grids(mirrored))
    assert len(plain) > 50
    true = {
        (int(b), shown.boards[b].columns - 1 - int(c), int(r)): pixel
        for b, c, r, pixel in zip(plain.board, plain.column, plain.row, plain.pixel, strict=True)
    }
    own = list(zip(found.board.tolist(), found.column.tolist(), found.row.tolist(), strict=True))
    both = [(key, pixel) for key, pixel in zip(own, found.pixel, strict=True) if key in true]
    assert len(both) > 0.95 * len(true)
    assert len(own) - len(both) < 0.05 * len(true)
    off = [np.linalg.norm([photo.shape[1] - 1 - x, y] - true[key]) for key, (x, y) in both]
    assert np.median(off) < 0.05


@pytest.mark.slow
def test_mirrored_markers_are_drawn_as_they_are_read():
    """A photo of what the mirror shows, from where the camera stands in the mirror."""
    shown = MIXED.in_mirror()
    flip, mirror = np.diag([-1.0, 1, 1]), np.diag([1.0, 1, -1])
    rotation = flip @ Rotation.from_rotvec(POSE[0]).as_matrix() @ mirror
    pose = (Rotation.from_matrix(rotation).as_rotvec(), flip @ POSE[1])
    photo = photo_of(shown, pose=pose, supersample=3)
    found = find_marked_corners(photo, shown, find_grids(photo))
    error, recall = errors(found, shown, pose)
    assert error.max() < 0.5
    assert recall > 0.97
