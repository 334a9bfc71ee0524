"""What many photos share is said once, with their count and first names."""

import pytest

from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.identified import GridReport, Place, remark_lines, remark_of
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding

PART = (
    ": perhaps part of the board, placed in its middle; a lens does not depend on where, measuring "
)
PART += "the board would"


def report(verdict: Decided, size: tuple[int, int] = (6, 4)) -> GridReport:
    place = Place(board=0, turn=0, column=0, row=0) if verdict is Decided.CONVENTION else None
    return GridReport(
        verdict=verdict, place=place, corners=size[0] * size[1], size=size, ratio=9.0, rms_px=0.1
    )


def test_a_grid_that_is_named_needs_no_words():
    assert remark_of("a.jpg", report(Decided.NAMED)) is None


def test_one_photo_has_a_line_for_each_grid():
    remarks = [
        remark_of("a.jpg", report(Decided.CONVENTION)),
        remark_of("a.jpg", report(Decided.TOO_LARGE, (9, 7))),
        remark_of("a.jpg", report(Decided.TOO_LARGE, (8, 7))),
    ]
    large = (
        "corners is left out: larger than every board of the target; if it is a board of the "
        "target, correct its corners in the target file"
    )
    assert remark_lines(remarks) == [
        "a.jpg: a grid of 6x4 with 24 corners" + PART,
        f"a.jpg: a grid of 9x7 with 63 {large}",
        f"a.jpg: a grid of 8x7 with 56 {large}",
    ]


@pytest.mark.parametrize(
    ("count", "names"),
    [
        (2, "2 photos (0.jpg and 1.jpg): 2 grids"),
        (21, "21 photos (0.jpg, 1.jpg, 2.jpg, 3.jpg and 17 more photos): 21 grids"),
    ],
)
def test_what_photos_share_is_one_line(count, names):
    photos = [f"{index}.jpg" for index in range(count)]
    sizes = [(4, 6), (5, 3), *[(6, 4)] * count]
    remarks = [
        remark_of(photo, report(Decided.CONVENTION, size))
        for photo, size in zip(photos, sizes, strict=False)
    ]
    assert remark_lines(remarks) == [f"{names} of up to 6x4 corners{PART}"]


def test_several_grids_of_several_photos_are_counted():
    remarks = [remark_of(f"{n // 2}.jpg", report(Decided.NO_FIT)) for n in range(4)]
    (line,) = remark_lines(remarks)
    assert line == (
        "2 photos (0.jpg and 1.jpg): 4 grids of up to 6x4 corners are left out: they fit no "
        "place on the target; check corners, square, origin and axes of the boards in the target "
        "file"
    )


def test_what_is_about_no_grid():
    remarks = [
        Finding(code=Code.TOO_DARK, images=("a.jpg",)),
        Finding(code=Code.CANNOT_BE_READ, images=("b.jpg",), figures={"problem": "b.jpg is empty"}),
        Finding(code=Code.TOO_DARK, images=("c.jpg",)),
    ]
    assert remark_lines(remarks) == [
        "2 photos (a.jpg and c.jpg): no checkerboard found: too dark; expose it longer",
        "b.jpg is empty",
    ]
