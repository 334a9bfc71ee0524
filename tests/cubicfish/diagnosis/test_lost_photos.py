"""Photos that show boards and give no corners: many of them are told before anything else."""

import pytest
from seen import grid_evidence

from cubicfish.diagnosis.corner_count import many_lost
from cubicfish.find.identification.identified import CODES, Decided, PhotoReport, remark_of
from cubicfish.judge.codes import Code, Remedy, Severity
from tests.cubicfish.diagnosis.test_another_target import LARGE, ONE, identified, report


def lost_of(verdicts, sizes, target):
    """What is told of photos with one grid each; those of no verdict have all corners named."""
    grids = [
        (report(size, verdict or Decided.NAMED),)
        for verdict, size in zip(verdicts, sizes, strict=True)
    ]
    lost = [
        remark_of(f"{number}.png", grid)
        for number, (grid,) in enumerate(grids)
        if grid.verdict is not Decided.NAMED
    ]
    return many_lost(grid_evidence(identified(*grids), target, lost=lost))


@pytest.mark.parametrize("verdict", list(CODES)[1:])
@pytest.mark.parametrize(("count", "reported"), [(3, False), (4, True)])
def test_more_than_a_third_of_the_photos_are_reported(verdict, count, reported):
    found = lost_of([verdict] * count + [None] * (9 - count), [(6, 4)] * 9, LARGE)
    assert len(found) == reported
    for one in found:
        assert (one.code, one.case, one.severity) == (CODES[verdict], "many", Severity.CARE)
        assert one.images == ("0.png", "1.png", "2.png", "3.png")


def test_photos_that_are_lost_for_several_reasons_are_many_for_none():
    reasons = [Decided.SLIDE, Decided.SLIDE, Decided.AMBIGUOUS, Decided.AMBIGUOUS, None, None]
    assert lost_of(reasons, [(6, 4)] * 6, LARGE) == []


def test_one_of_two_photos_may_be_another_boards():
    assert lost_of([Decided.TOO_LARGE, None], [(12, 9), (9, 7)], ONE) == []


def test_of_a_board_that_is_larger_the_sizes_are_reported():
    sizes = [(11, 8), (8, 11), (11, 8), (14, 12), (9, 7)]
    (reported,) = lost_of([Decided.TOO_LARGE] * 4 + [None], sizes, ONE)
    assert (reported.code, reported.remedy) == (Code.TOO_LARGE, Remedy.CORRECT_TARGET)
    assert "11x8 (in 3)" in reported.figures["seen"]


def test_the_largest_grid_says_why_a_photo_is_lost():
    own = [report((3, 5), Decided.SLIDE), report((6, 4), Decided.AMBIGUOUS)]
    remarks = tuple(remark_of("a.png", one) for one in own)
    photo = PhotoReport(name="a.png", remarks=remarks, grids=tuple(own))
    assert photo.loss.code == Code.AMBIGUOUS
    some_named = (*own, report((6, 4), Decided.NAMED))
    assert PhotoReport(name="a.png", remarks=remarks, grids=some_named).loss is None
