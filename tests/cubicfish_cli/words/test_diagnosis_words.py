"""What sentences say of findings that tests of the library make."""

import numpy as np
import pytest
from seen import grid_evidence
from synthetic import flat_board
from told import raises_told

from cubicfish import DetectionError, detect
from cubicfish.diagnosis.corner_count import Count, another_target, nothing_named
from cubicfish.find.detection.diagnose import explain_no_grids
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.identification.identified import Decided
from cubicfish_cli.words.sentences import render
from tests.cubicfish.diagnosis.test_another_target import LARGE, ONE, identified, report
from tests.cubicfish.diagnosis.test_lost_photos import lost_of
from tests.cubicfish.diagnosis.test_miscounted import THREE, in_words, resized
from tests.cubicfish.find.detection.test_dots import dots
from tests.cubicfish.find.detection.test_finder import textures


def test_a_board_of_other_counts_is_said_with_what_to_do() -> None:
    counts = [Count(board=0, size=(9, 6), photos=8)]
    (finding,) = in_words(counts, resized(THREE, 0, 10, 6), 10)
    assert (finding.code, finding.severity, finding.boards) == ("corner_count", "care", ("floor",))
    assert render(finding).line == (
        "board floor: the target says 10x6 inner corners, 8 of 10 photos show 9x6 (no photo shows "
        "more); correct the corner counts in target.yaml (or --board) and run again (origin too, "
        "if it was that of a missing corner), unless something covers the rest in all photos"
    )
    assert in_words([], THREE, 10) == []


def test_several_boards_are_said_in_one_line() -> None:
    target = resized(resized(THREE, 0, 10, 7), 2, 8, 6)
    counts = [Count(board=0, size=(9, 6), photos=8), Count(board=2, size=(7, 5), photos=5)]
    (finding,) = in_words(counts, target, 10)
    assert finding.boards == ("floor", "right")
    assert render(finding).what == (
        "board floor: the target says 10x7 inner corners, 5 to 8 of 10 photos show 9x6 and board "
        "right: the target says 8x6 inner corners, 5 to 8 of 10 photos show 7x5"
    )


def test_many_photos_that_are_lost_are_counted() -> None:
    (lost,) = lost_of([Decided.SLIDE] * 4 + [None] * 5, [(6, 4)] * 9, LARGE)
    assert render(lost).what.startswith(
        "4 of the 9 photos in which boards were found are left out: "
    )
    assert render(lost).do
    sizes = [(11, 8), (8, 11), (11, 8), (14, 12), (9, 7)]
    (large,) = lost_of([Decided.TOO_LARGE] * 4 + [None], sizes, ONE)
    assert "of 11x8 (in 3) inner corners" in render(large).what


def test_another_target_is_said_with_both_sizes() -> None:
    seen = identified(*[(report((6, 4), Decided.SLIDE),)] * 5)
    (said,) = nothing_named(grid_evidence(seen, LARGE))
    assert render(said).what == (
        "5 photos show grids of 6x4 inner corners, but the target has boards of another "
        "size (floor 9x7, wall 8x6)"
    )
    seen = identified(*[(report((7, 7), Decided.NAMED),)] * 3)
    counts = [Count(board=0, size=(7, 7), photos=3)]
    (said,) = another_target(grid_evidence(seen, ONE, counts=counts))
    assert render(said).what == (
        "3 photos show grids of 7x7 inner corners, but the target has one board of another "
        "size (b 9x7)"
    )


def test_parts_of_boards_are_wanted_with_their_ends() -> None:
    photos = [(report((6, number), Decided.SLIDE),) for number in (3, 4, 5, 6)]
    (said,) = nothing_named(grid_evidence(identified(*photos), LARGE))
    assert "take photos that show two boards, or the ends of a board" in render(said).do


def test_dots_are_said_once() -> None:
    pictures = [dots(), dots(columns=8), np.full((480, 640), 90, np.uint8)]
    with raises_told(DetectionError, r"^3 photos, no checkerboard: a grid of about 63 dots"):
        detect(pictures, flat_board())


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(textures()))
def test_why_there_is_no_grid_is_short(name: str) -> None:
    image = np.clip(textures()[name], 0, 255).astype(np.uint8)
    assert len(render(explain_no_grids(image, find_grids(image))).what) < 120
