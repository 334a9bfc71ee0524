"""One line when target.yaml is of another object: what photos show, what it has, what to do."""

import numpy as np
import pytest
from seen import grid_evidence
from synthetic import IMAGE_SIZE, checkerboard, corner_of_three

from cubicfish.diagnosis.corner_count import Count, another_target, nothing_named
from cubicfish.find.identification.identified import Decided, GridReport, Identified, Place
from cubicfish.judge.codes import Code
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target

LARGE = Target(
    units="mm",
    boards=(
        checkerboard("floor", 9, 7, 30.0),
        checkerboard("wall", 8, 6, 30.0, (0, 0, 300), (0, 1, 0), (0, 0, 1)),
    ),
)
ONE = Target(units="mm", boards=(checkerboard("b", 9, 7, 30.0),))


def report(size, verdict, corners=None):
    place = Place(board=0, turn=0, column=0, row=0) if verdict is Decided.NAMED else None
    return GridReport(
        verdict=verdict,
        place=place,
        corners=corners or size[0] * size[1],
        size=size,
        rms_px=0.1,
    )


def identified(*photos):
    none = np.zeros(0, np.intp)
    corners = Observations(
        image_size=IMAGE_SIZE, images=(), boards=(), image=none, board=none, column=none,
        row=none, pixel=np.zeros((0, 2)), weight=np.zeros(0),
    )  # fmt: skip
    return Identified(corners=corners, found=(), grids=photos, exact=np.ones(len(photos), bool))


@pytest.mark.parametrize("size", [(6, 4), (4, 6), (8, 7), (12, 10)])
def test_one_grid_in_all_photos_that_is_no_board(size):
    verdict = Decided.TOO_LARGE if max(size) > 9 else Decided.SLIDE
    (said,) = nothing_named(grid_evidence(identified(*[(report(size, verdict),)] * 5), LARGE))
    assert said.code == Code.ANOTHER_TARGET
    assert said.figures["seen"] == f"{max(size)}x{min(size)}"


def test_parts_of_boards_are_not_another_object():
    """Each photo shows another part: what is missing is an end."""
    photos = [(report((6, number), Decided.SLIDE),) for number in (3, 4, 5, 6)]
    (said,) = nothing_named(grid_evidence(identified(*photos), LARGE))
    assert (said.code, said.figures["why"]) == (Code.NOTHING_NAMED, Code.SLIDES)


def test_boards_alike_are_wanted_together():
    (said,) = nothing_named(
        grid_evidence(identified(*[(report((9, 7), Decided.TWIN),)] * 3), LARGE)
    )
    assert (said.code, said.figures["why"]) == (Code.NOTHING_NAMED, Code.LOOKS_LIKE_ANOTHER)


def test_whole_boards_that_fit_nowhere_are_not_another_object():
    photos = [(report((9, 7), Decided.NO_FIT), report((8, 6), Decided.NO_FIT))] * 4
    (said,) = nothing_named(grid_evidence(identified(*photos), LARGE))
    assert (said.code, said.figures["why"]) == (Code.NOTHING_NAMED, Code.FITS_NOWHERE)


@pytest.mark.parametrize(
    ("size", "wrong"), [((9, 6), False), ((8, 7), False), ((7, 7), True), ((6, 4), True)]
)
def test_a_lone_board_that_is_off_by_more_than_a_line_is_another_one(size, wrong):
    seen = identified(*[(report(size, Decided.NAMED),)] * 3)
    counts = [Count(board=0, size=size, photos=3)]
    found = another_target(grid_evidence(seen, ONE, counts=counts))
    assert len(found) == wrong
    for said in found:
        assert said.code == Code.ANOTHER_TARGET
        assert said.figures["seen"] == f"{size[0]}x{size[1]}"


def test_few_names_among_grids_that_are_too_large():
    large, small = report((14, 12), Decided.TOO_LARGE), report((5, 3), Decided.NAMED)
    photos = [(large, small)] * 4
    (reported,) = another_target(grid_evidence(identified(*photos), corner_of_three()))
    assert reported.figures["seen"] == "14x12 (in 4) and 5x3 (in 4)"


def test_the_boards_of_another_target_are_reported_beside_a_lone_one():
    """Three boards where the target is to have one: their sizes, those of most photos first."""
    sizes = [[(9, 6), (8, 7)], [(6, 9)], [(9, 6), (8, 7), (5, 4)]]
    verdicts = {(5, 4): Decided.NAMED}
    photos = [tuple(report(s, verdicts.get(s, Decided.TOO_LARGE)) for s in own) for own in sizes]
    small = Target(units="mm", boards=(checkerboard("board", 5, 4, 30.0),))
    (reported,) = another_target(grid_evidence(identified(*photos, photos[1]), small, counts=[]))
    assert reported.figures["seen"] == "9x6 (in 4) and 8x7 (in 2)"


def test_a_larger_board_in_the_background_is_no_other_object():
    large, own = report((14, 12), Decided.TOO_LARGE), report((7, 5), Decided.NAMED)
    photos = [(large, own, own)] * 4
    assert not another_target(grid_evidence(identified(*photos), corner_of_three()))
    assert not another_target(grid_evidence(identified(*photos), ONE, counts=[]))
