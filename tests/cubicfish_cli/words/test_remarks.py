"""What many photos share is said once, with their count and first names."""

from dataclasses import replace

import numpy as np
import pytest
from anonymous_grids import anonymous_photos
from synthetic import IMAGE_SIZE, checkerboard, flat_board, poses_around, synthetic_corners

from cubicfish.find.identification.identified import (
    Decided,
    GridReport,
    Place,
    nominal_target_fits,
    remark_of,
)
from cubicfish.find.identification.name_grids import name_grids
from cubicfish.judge.codes import Code, Remedy, Severity
from cubicfish.judge.finding import Finding
from cubicfish.models.radial import RadialCamera
from cubicfish.target.target import Target
from cubicfish_cli.words.remarks import remark_lines
from cubicfish_cli.words.sentences import render, render_short

MATTERS = "; this does not matter for the lens, only for measuring the board"
PART = f" may show only part of the board; it is placed in the board's middle{MATTERS}"
PARTS = f" may show only part of the board; each is placed in its middle{MATTERS}"


def report(verdict: Decided, size: tuple[int, int] = (6, 4)) -> GridReport:
    place = Place(board=0, turn=0, column=0, row=0) if verdict is Decided.CONVENTION else None
    return GridReport(
        verdict=verdict, place=place, corners=size[0] * size[1], size=size, rms_px=0.1
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
        "corners is left out: it is larger than any board of the target; if it is a board of the "
        "target, correct the corner counts in target.yaml (or --board)"
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
    assert remark_lines(remarks) == [f"{names} of up to 6x4 corners{PARTS}"]


def test_several_grids_of_several_photos_are_counted():
    remarks = [remark_of(f"{n // 2}.jpg", report(Decided.NO_FIT)) for n in range(4)]
    (line,) = remark_lines(remarks)
    assert line == (
        "2 photos (0.jpg and 1.jpg): 4 grids of up to 6x4 corners are left out: they fit "
        "nowhere on the target; check corners, square, origin and axes of the boards in target.yaml"
    )


def test_what_is_about_no_grid():
    remarks = [
        Finding(code=Code.TOO_DARK, images=("a.jpg",)),
        Finding(code=Code.CANNOT_BE_READ, images=("b.jpg",), figures={"problem": "b.jpg is empty"}),
        Finding(code=Code.TOO_DARK, images=("c.jpg",)),
    ]
    assert remark_lines(remarks) == [
        "2 photos (a.jpg and c.jpg): no checkerboard found: too dark; use a longer exposure",
        "b.jpg is empty",
    ]


def test_photos_of_one_fault_share_a_line_and_the_largest_figure_of_it():
    remarks = [
        Finding(code=Code.NOISY, images=(photo,), figures={"times": times})
        for photo, times in (("a.jpg", 4.2), ("b.jpg", 6.3), ("c.jpg", 5.0))
    ]
    assert remark_lines(remarks) == [
        "3 photos (a.jpg, b.jpg and c.jpg): their corners are up to 6 times noisier than those of "
        "the other photos: blurred, moving or badly lit; take them again"
    ]
    assert remark_lines(remarks[:1])[0].startswith("a.jpg: its corners are 4 times noisier")


WIDE = RadialCamera(
    image_size=IMAGE_SIZE,
    fx=330.0,
    fy=330.2,
    cx=(IMAGE_SIZE[0] - 1) / 2 + 6,
    cy=(IMAGE_SIZE[1] - 1) / 2 - 4,
    k=np.array([-0.02, -0.004, 0.001, 0.0]),
)
LONE = flat_board()
TWO = Target(
    units="mm",
    boards=(checkerboard("a", 8, 6, 30.0), checkerboard("b", 7, 5, 30.0, (400.0, 0.0, 0.0))),
)


def test_a_photo_of_another_camera_is_not_blamed_on_the_drawing():
    poses = poses_around(LONE, 9, distance=(0.4, 0.8), off_axis_deg=30, seed=3)
    grids, _ = anonymous_photos(synthetic_corners(LONE, poses, lens=WIDE, noise=0.1), LONE)
    middle = (np.array(IMAGE_SIZE) - 1) / 2
    (one,) = grids[4]
    other = [*grids[:4], (replace(one, pixel=middle + 1.4 * (one.pixel - middle)),), *grids[5:]]
    photos = [f"{number}.png" for number in range(9)]
    identified = name_grids(other, LONE, IMAGE_SIZE, photos)
    odd = nominal_target_fits(identified.grids, LONE)
    remarks = [
        remark_of(photo, own[0], odd=odd)
        for photo, own in zip(photos, identified.grids, strict=True)
    ]
    assert [number for number, remark in enumerate(remarks) if remark] == [4]
    reported = remarks[4]
    assert reported.code in (Code.FITS_NOWHERE, Code.NO_PLANE)
    assert (reported.case, reported.remedy) == ("odd", Remedy.LEAVE_OUT)
    assert render_short(reported) != render(reported).line


def named(board=0):
    return replace(report(Decided.NAMED), place=Place(board=board, turn=0, column=0, row=0))


@pytest.mark.parametrize(
    ("photos", "fits"),
    [
        ([(named(), named(1))] * 3 + [(report(Decided.NO_FIT),)] * 2, True),
        # A board that never fits may be drawn wrongly.
        ([(named(),)] * 3 + [(named(), report(Decided.NO_FIT))] * 2, False),
        # So may all, where most photos do not fit.
        ([(named(), named(1))] * 2 + [(report(Decided.NO_FIT),)] * 3, False),
        # A few corners may be anything.
        ([(named(), named(1))] * 2 + [(named(), report(Decided.NO_FIT, (3, 2)))] * 3, True),
    ],
)
def test_the_drawing_is_right_where_most_photos_fit_it(photos, fits):
    assert nominal_target_fits(photos, TWO) is fits


def test_photos_in_which_about_the_same_was_seen_share_a_line():
    seen = [
        Finding(
            code=Code.BLURRED,
            case="grid",
            severity=Severity.CARE,
            images=(name,),
            figures={
                "columns": columns, "rows": 4, "side_px": 90.0, "blur_px": blur, "seen_at": "half"
            },
        )
        for name, columns, blur in (("a.png", 6, 9.0), ("b.png", 5, 11.0))
    ]  # fmt: skip
    (line,) = remark_lines(seen)
    assert line.startswith("2 photos (a.png and b.png): ")
