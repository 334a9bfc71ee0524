"""Boards of unknown places: measured from photos, and grids that a wrong place leaves out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import yaml
from anonymous_grids import anonymous_photos
from samples import SAMPLE

from cubicfish import Target, TargetError, load_corners
from cubicfish.diagnosis.corner_count import many_grids_left_out
from cubicfish.diagnosis.evidence import GridEvidence
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.judge.codes import Code, Severity
from cubicfish.observe.places import placed_by_grids, told_of_places, with_places

TRUE = Target.load(SAMPLE / "target.yaml")
TABLE = SAMPLE / "true_corners.csv"


def written(**places):
    """The sample's target with other places, or none, of boards by their names."""
    data = yaml.safe_load((SAMPLE / "target.yaml").read_text())
    for board in data["boards"]:
        if board["name"] in places:
            for key in ("origin", "x_axis", "y_axis"):
                del board[key]
            board.update(places[board["name"]])
    return data


UNKNOWN = Target.from_data(written(left={"place": "unknown"}, right={"place": "unknown"}))


@cache
def corners():
    return load_corners(TABLE, TRUE)


def off_mm(target):
    points = [
        np.concatenate([board.world_points(*board.places()) for board in one.boards])
        for one in (target, TRUE)
    ]
    return float(np.linalg.norm(points[0] - points[1], axis=1).max())


def test_places_are_found_by_grids_without_names():
    photos, _ = anonymous_photos(corners(), TRUE, least=12)
    names = corners().images
    placed = placed_by_grids(photos, UNKNOWN, corners().image_size, names)
    assert placed.unplaced == ()
    # The board whose half turn looks like itself may have its first corner at either end.
    right = placed.boards[2]
    if right.x_axis @ TRUE.boards[2].x_axis < 0:
        turned = replace(
            right,
            origin=right.world_points(6, 4),
            x_axis=-right.x_axis,
            y_axis=-right.y_axis,
        )
        placed = placed.with_boards({2: turned})
    assert off_mm(placed) < 0.2


def test_a_board_counted_from_either_end_is_placed_all_the_same():
    flipped = (corners().board == 2) & (corners().image % 2 == 1)
    column = np.where(flipped, 6 - corners().column, corners().column)
    row = np.where(flipped, 4 - corners().row, corners().row)
    placed = with_places(replace(corners(), column=column, row=row), UNKNOWN)
    assert off_mm(placed) < 0.2


def test_boards_that_no_photo_shows_together_are_not_placed():
    alone = corners().select(corners().board == corners().image % 3)
    placed = with_places(alone, UNKNOWN)
    assert placed.unplaced == ("left", "right")
    (told,) = told_of_places(UNKNOWN, placed, ("floor", "left"))
    assert (told.code, told.case, told.boards) == (Code.BOARD_PLACE, "not_found", ("left",))
    assert told.severity is Severity.CARE


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ({"place": "there"}, "left', place"),
        ({"place": "unknown", "origin": [0, 0, 0]}, "origin: place: unknown is said too"),
    ],
)
def test_a_place_that_is_half_said_is_refused(place, said):
    with pytest.raises(TargetError, match=said):
        Target.from_data(written(left=place))


def test_unknown_places_stay_unknown_in_files_and_one_board_is_the_world():
    assert Target.from_data(yaml.safe_load(UNKNOWN.text())).unplaced == ("left", "right")
    none = Target.from_data(written(**{name: {"place": "unknown"} for name in TRUE.board_names}))
    assert none.unplaced == ("left", "right")
    np.testing.assert_array_equal(none.boards[0].axes, np.eye(3))


def test_grids_that_a_wrong_place_leaves_out_are_counted():
    there = {"x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
    wrong = Target.from_data(
        written(left={**there, "origin": [2000, 0, 0]}, right={**there, "origin": [4000, 0, 0]})
    )
    photos, _ = anonymous_photos(corners(), TRUE, least=12)

    def found(target):
        identified = name_grids(photos, target, corners().image_size, corners().images)
        return many_grids_left_out(
            GridEvidence(
                photos=len(photos),
                names=corners().images,
                picture=lambda _: None,
                target=target,
                with_boards=len(photos),
                lost=[],
                identified=identified,
            )
        )

    assert not found(TRUE)
    (one,) = found(wrong)
    assert (one.code, one.severity) == (Code.FITS_NOWHERE, Severity.CARE)
    assert one.figures["left_out"] > one.figures["grids"] / 2
    assert one.figures["grids"] == sum(map(len, photos))
