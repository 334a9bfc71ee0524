"""What may be wrong with a set-up: why corners do not fit as they should."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from cubicfish import listed
from cubicfish.judge import Code
from cubicfish.judge import FindingText as Said
from cubicfish_cli.words.phrases import (
    length_words,
    near_duplicates,
    percent,
    pick,
    plural,
    whole,
)
from cubicfish_cli.words.table import Words

Names = Sequence[str]
Colour = Literal["light", "dark"]

CORRECT = "correct target.yaml and calibrate again"
COUNTS = "the corner counts in target.yaml (or --board)"
MIRROR = "if the camera looks into a mirror, set mirrored: true at the top of target.yaml"
_RERUN = "correct target.yaml and run again"
_ORDER = "correct target.yaml, or the order in corners.csv, and calibrate again"
_WITHOUT_IT = f"{_ORDER}; the camera was fitted without this board"
_MEASURE = f"measure its origin and axes again, {CORRECT}"
_ROWS = "correct these rows of corners.csv, or leave the"
_NOT_MIRRORED = "remove mirrored: true from target.yaml"
_AS_MADE = "use the original photos"
WORDS = Words(
    findings={
        (Code.MIRRORED, "target"): Said(
            "all photos are mirrored: the target fits as seen in a mirror",
            do=f"{_AS_MADE}, not flipped as in a video call; {MIRROR} and detect the corners again",
        ),
        (Code.MIRRORED, "points"): Said(
            "all photos are mirrored, or the points' coordinates are: the target fits as seen in a "
            "mirror",
            do=f"{_AS_MADE}, and points in a right-handed frame",
        ),
        (Code.MIRRORED, "behind"): Said(
            "every photo shows the board from behind: either the photos are mirrored, and then so "
            "is the camera, or columns or rows are counted the other way round",
            "seen from the front, rows must run clockwise from columns",
            "compare a photo with the board; if only the counting differs, the camera is right and "
            "the poses are of the board's back",
        ),
        (Code.MIRRORED, "all_grids"): Said(
            "all photos are mirrored", do=f"{_AS_MADE}, not flipped as in a video call; {MIRROR}"
        ),
        (Code.MIRRORED, "none"): Said("no photo is mirrored", do=_NOT_MIRRORED),
    }
)


@WORDS.because("apart")
def _apart(together_px: float, apart_px: float) -> str:
    return f"RMS {together_px:.2f} px together, {apart_px:.2f} px apart"


@WORDS.because("own_lens")
def _own_lens(own_px: float) -> str:
    return f"fitted separately, they reach {own_px:.2f} px"


@WORDS.because("own_lens_before")
def _own_lens_before(own_px: float) -> str:
    return f"fitted separately, the earlier photos reach {own_px:.2f} px"


@WORDS.because("refined")
def _refined(before_px: float, after_px: float) -> str:
    return f"RMS {before_px:.2f} px as drawn, {after_px:.2f} px as it really is"


@WORDS.because("corrected")
def _corrected(after_px: float) -> str:
    return f"once corrected, the typical error falls to {after_px:.2g} px"


@WORDS.because("put_right")
def _put_right(before: float, after: float) -> str:
    found = f"{whole(before)} of the corners have a place on the target as drawn"
    return f"{found}, {whole(after)} once corrected"


def _shown(photos: int, error_px: float) -> str:
    return (
        f"{plural(photos, 'photo')} {pick(photos, 'shows', 'show')} it; once corrected, its "
        f"corners are within {error_px:.2f} px of where the other boards put them"
    )


Order = Literal[
    "columns_backwards", "rows_backwards", "half_a_turn", "exchanged", "exchanged_size",
    "a_quarter_turn", "x_axis", "y_axis", "both_axes", "other_end", "colours", "some_colours",
]  # fmt: skip
_ORDERS: Mapping[Order, str] = {
    "columns_backwards": "columns are counted the other way round",
    "rows_backwards": "rows are counted the other way round",
    "half_a_turn": "corners are counted from the opposite corner (the board is turned by 180°)",
    "exchanged": "rows and columns are swapped",
    "exchanged_size": "rows and columns are swapped: corners: [{columns}, {rows}] for [{rows}, "
    "{columns}]",
    "a_quarter_turn": "the board is turned by 90° relative to the target",
    "x_axis": "x_axis points the wrong way",
    "y_axis": "y_axis points the wrong way",
    "both_axes": "x_axis and y_axis point the wrong way",
    "other_end": "columns run the wrong way: origin belongs at their other end",
    "colours": "its squares are dark where the target says light: set first_square: {first_square}",
    "some_colours": "its squares are dark where the target says light",
}
Named = Literal[
    "columns_backwards", "rows_backwards", "half_a_turn", "exchanged", "a_quarter_turn",
    "other_board", "columns", "rows", "both",
]  # fmt: skip
Units = Literal["inches_mm", "cm_mm", "m_mm", "inches_cm", "inches_for_mm", "cm_for_mm"]
_UNITS: Mapping[Units, str] = {
    "inches_mm": "inches and millimetres",
    "cm_mm": "centimetres and millimetres",
    "m_mm": "metres and millimetres",
    "inches_cm": "inches and centimetres",
    "inches_for_mm": "inches and millimetres",
    "cm_for_mm": "centimetres and millimetres",
}
Which = Literal["all", "one"]


def _which(which: Which, board: str) -> str:
    return "all boards" if which == "all" else f"board {board}"


def _order(order: Order, columns: int, rows: int, first_square: str) -> str:
    return _ORDERS[order].format(columns=columns, rows=rows, first_square=first_square)


@WORDS.finding(Code.BOARD_ORDER, "", "grids")
def _board_order(
    case: str,
    board: str,
    which: Which,
    order: Order,
    columns: int = 0,
    rows: int = 0,
    first_square: str = "",
) -> Said:
    what = f"{_which(which, board)}: {_order(order, columns, rows, first_square)}"
    return Said(what, do=_RERUN if case == "grids" else _ORDER)


@WORDS.finding(Code.BOARD_ORDER, "first_square")
def _begins_otherwise(board: str, first_square: Colour, corners: int, named: int) -> Said:
    return Said(
        f"board {board} begins with a {first_square} square",
        f"{corners:,} of its corners are found so, and {named or 'none'} as the target says",
        f"write first_square: {first_square} for it in target.yaml; this result has it already",
    )


@WORDS.finding(Code.BOARD_ORDER, "of_photos")
def _board_order_of_photos(board: str, order: Order, photos: int, error_px: float) -> Said:
    what = f"board {board}: {_order(order, 0, 0, '')}"
    return Said(what, _shown(photos, error_px), _WITHOUT_IT)


@WORDS.finding(Code.BOARD_NAMES)
def _board_names(boards: Names) -> Said:
    do = "swap them in target.yaml, or in corners.csv, and calibrate again"
    return Said(f"the names of boards {boards[0]} and {boards[1]} are swapped", do=do)


@WORDS.finding(Code.BOARD_NAMES, "places")
def _board_names_places(boards: Names) -> Said:
    return Said(f"the places of boards {boards[0]} and {boards[1]} are swapped", do=_RERUN)


@WORDS.finding(Code.BOARD_NAMES, "of_photos")
def _board_names_of_photos(board: str, other: str, photos: int, error_px: float) -> Said:
    what = f"board {board}: its corners are those of board {other}"
    return Said(what, _shown(photos, error_px), _WITHOUT_IT)


@WORDS.finding(Code.BOARD_PLACE, "", "and_square", "of_two", "of_two_and_square")
def _board_place(
    case: str, board: str, shift: float, units: str, turn_deg: float, off: float, both: Names
) -> Said:
    where = f"lies {shift:.2g} {units} / {turn_deg:.1f}° from where target.yaml puts it"
    of = f"boards {listed(both, 'boards')}: " if case in ("of_two", "of_two_and_square") else ""
    squares = f", and its squares are off by {percent(off)}"
    resized = case in ("and_square", "of_two_and_square")
    return Said(f"{of}board {board} {where}{squares * resized}", do=_MEASURE)


@WORDS.finding(Code.BOARD_PLACE, "found")
def _board_place_found(boards: Names) -> Said:
    places = pick(boards, "the place", "the places")
    return Said(f"{places} of {listed(boards, 'boards')} {pick(boards, 'was', 'were')} measured")


@WORDS.finding(Code.BOARD_PLACE, "not_found")
def _board_place_not_found(boards: Names) -> Said:
    return Said(
        f"{listed(boards, 'boards')} {pick(boards, 'is', 'are')} left out: "
        f"{pick(boards, 'its place', 'their places')} could not be measured",
        do="take at least three photos that show two boards at a time, one of them whole",
    )


@WORDS.finding(Code.FITS_NOWHERE, "many_grids")
def _many_grids_left_out(left_out: int, grids: int, unseen: str = "") -> Said:
    none = f", among them all of {unseen}" if unseen else ""
    return Said(
        f"{left_out} of {grids} grids are left out{none}",
        do="check corners, square, origin and axes of the boards in target.yaml, or say place: "
        "unknown for boards whose places were not measured",
    )


@WORDS.finding(Code.BOARD_PLACE, "in_most")
def _board_place_in_most(board: str, photos: int) -> Said:
    what = f"board {board} is not where target.yaml puts it relative to the other boards"
    return Said(
        what,
        f"{plural(photos, 'photo')} {pick(photos, 'shows', 'show')} it, and "
        f"{pick(photos, 'fits', 'fit')} without this board",
        _MEASURE,
    )


@WORDS.finding(Code.BOARD_PLACE, "of_photos")
def _board_place_of_photos(
    board: str,
    named: Named,
    photos: int,
    error_px: float,
    other: str = "",
    column_steps: int = 0,
    columns_far: bool = False,
    row_steps: int = 0,
    rows_far: bool = False,
) -> Said:
    steps = _named(named, other, column_steps, columns_far, row_steps, rows_far)
    what = f"board {board}: its corners are misnamed: {steps}"
    return Said(what, _shown(photos, error_px), _WITHOUT_IT)


def _named(
    named: Named,
    other: str,
    column_steps: int,
    columns_far: bool,
    row_steps: int,
    rows_far: bool,
) -> str:
    columns = f"{plural(column_steps, 'column')} too {pick(columns_far, 'far', 'near')}"
    rows = f"{plural(row_steps, 'row')} too {pick(rows_far, 'far', 'near')}"
    ways: Mapping[Named, str] = {
        "columns_backwards": "columns counted backwards",
        "rows_backwards": "rows counted backwards",
        "half_a_turn": "counted from the opposite corner",
        "exchanged": "rows and columns swapped",
        "a_quarter_turn": "turned by 90°",
        "other_board": f"they belong to board {other}",
        "columns": columns,
        "rows": rows,
        "both": f"{columns} and {rows}",
    }
    return ways[named]


@WORDS.finding(Code.BOARD_PLACE, "moved")
def _board_place_moved(board: str, images: Names) -> Said:
    these = pick(images, "this photo", "these photos")
    return Said(
        f"{listed(images, 'photos')}: board {board} is not where it is in the other photos: it "
        "moved, or its corners are misnamed",
        f"without it {pick(images, 'the photo fits', 'the photos fit')}",
        f"look at {these} with 'cubicfish detect --draw', or leave {pick(images, 'it', 'them')} "
        "out",
    )


@WORDS.finding(Code.BOARD_SQUARE)
def _board_square(board: str, off: float, real: str) -> Said:
    what = f"the squares of board {board} are off by {percent(off)}, relative to the other boards"
    return Said(f"{what} ({real})", do=f"measure ten squares of {board}, {CORRECT}")


@WORDS.finding(Code.BOARD_SQUARE, "all")
def _board_square_all(off: float, real: str) -> Said:
    what = f"the squares of all boards are off by {percent(off)}, relative to the distances between"
    return Said(f"{what} boards ({real})", do=f"measure ten squares, {CORRECT}")


@WORDS.finding(Code.BOARD_SQUARE, "units", "all_units")
def _board_square_units(case: str, board: str, times: float, units_mixed: Units, real: str) -> Said:
    boards, of = ("all boards", "") if case == "all_units" else (f"board {board}", f" of {board}")
    what = f"the squares of {boards} are off by a factor of {times:.4g}: "
    what += f"{_UNITS[units_mixed]} are mixed up"
    return Said(f"{what} ({real})", do=f"measure ten squares{of}, {CORRECT}")


@WORDS.finding(Code.BOARD_SQUARE, "grids")
def _board_square_grids(
    board: str, which: Which, times: float, small: bool, units_mixed: Units
) -> Said:
    size = f"too {pick(small, 'small', 'large')} by a factor of {times:g}"
    what = f"{_which(which, board)}: squares are {size}: {_UNITS[units_mixed]} are mixed up"
    return Said(what, do=_RERUN)


@WORDS.finding(Code.BOARD_SQUARE, "distance")
def _board_square_distance(distance_mm: float, square: float, units: str) -> Said:
    away = length_words(distance_mm, "mm")
    size = f"a square of {square:g} {units}" if square else f"a target in {units}"
    return Said(
        f"{size} puts the camera {away} away (median), which is implausible",
        do="check the size and its unit: the lens does not depend on it, but all distances do",
    )


@WORDS.finding(Code.BOARD_SQUARE, "spacing")
def _board_square_spacing(board: str, gaps: int, spacing: float, drawn_spacing: float) -> Said:
    return Said(
        f"the gaps between tags of board {board} are {spacing:.3g} of a tag's side (the target "
        f"says spacing: {drawn_spacing:g})",
        f"measured on {plural(gaps, 'gap')}",
        "correct spacing in target.yaml: the gap between two tags divided by the side of a tag",
    )


@WORDS.finding(Code.CORNER_NAMES, "", "all_boards")
def _corner_names(
    case: str,
    images: Names,
    named: Named,
    error_px: float,
    board: str = "",
    other: str = "",
    column_steps: int = 0,
    columns_far: bool = False,
    row_steps: int = 0,
    rows_far: bool = False,
) -> Said:
    steps = _named(named, other, column_steps, columns_far, row_steps, rows_far)
    photos, out = listed(images, "photos"), f"{_ROWS} {pick(images, 'photo', 'photos')} out"
    if case == "all_boards":
        fits = pick(images, "the photo fits", "the photos fit")
        what = f"{photos}: corners of all boards are misnamed: {steps}"
        return Said(what, f"once corrected, {fits} to {error_px:.2f} px", out)
    what = f"{photos}: corners of board {board} are misnamed: {steps}"
    return Said(
        what, f"once corrected, they are within {error_px:.2f} px of where the rest puts them", out
    )


@WORDS.finding(Code.CORNER_COUNT)
def _corner_count(
    counts: Sequence[Mapping[str, Any]],
    alike: bool,
    fewest: int,
    most: int,
    photos: int,
) -> Said:
    many = f"{fewest if alike else f'{fewest} to {most}'} of {photos} photos"
    many = f"all {photos} photos" if fewest == photos else many
    seen = [
        "board {board}: the target says {drawn_columns}x{drawn_rows} inner corners, {many} show "
        "{columns}x{rows}".format(many=many, **one)
        for one in counts
    ]
    return Said(
        listed(seen, "boards"),
        "no photo shows more",
        f"correct {COUNTS} and run again (origin too, if it was that of a missing corner), unless "
        "something covers the rest in all photos",
    )


@WORDS.finding(Code.CORNER_COUNT, "squares")
def _corner_count_squares(
    boards: Names, columns: int, rows: int, drawn_columns: int, drawn_rows: int
) -> Said:
    return Said(
        f"{pick(boards, 'board', 'boards')} {listed(boards, 'boards')}: the target seems to count "
        f"squares, {drawn_columns}x{drawn_rows}, where {columns}x{rows} inner corners are seen",
        f"photos show all of {boards[0]} but its last column and row",
        f"correct {COUNTS}; the camera does not depend on it",
    )


@WORDS.finding(Code.CORNER_COUNT, "all_squares")
def _corner_count_all_squares(
    columns: int, rows: int, drawn_columns: int, drawn_rows: int, photos: int
) -> Said:
    return Said(
        f"found {columns}x{rows} inner corners in {plural(photos, 'photo')}, but the target says "
        f"{drawn_columns}x{drawn_rows}",
        do=f"were squares counted? Count corners where four squares meet, and correct {COUNTS}",
    )


@WORDS.finding(Code.CORNER_COUNT, "markers", "tags")
def _corner_count_markers(
    case: str,
    board: str,
    markers: int,
    columns: int,
    rows: int,
    drawn_columns: int,
    drawn_rows: int,
    first_square: str,
) -> Said:
    if case == "tags":
        things, of, say = "tags", "", f"tags: [{columns}, {rows}]"
    else:
        things, of = "markers", " of inner corners"
        say = f"corners: [{columns}, {rows}] and first_square: {first_square}"
    return Said(
        f"the {things} of board {board} fit {plural(columns, 'column')}{of}, of which "
        f"{plural(rows, 'row')} {pick(rows, 'is', 'are')} visible (the target says "
        f"{drawn_columns}x{drawn_rows})",
        f"{plural(markers, 'marker')} of one photo then "
        f"{pick(markers, 'agrees', 'agree')} on where the board is",
        f"set {say} for it in target.yaml, with more rows if no photo shows all",
    )


@WORDS.finding(Code.MIRRORED, "some")
def _mirrored_some(images: Names) -> Said:
    what = f"{listed(images, 'photos')} {pick(images, 'is', 'are')} mirrored, or "
    what += f"{pick(images, 'its', 'their')} corners are counted the other way round"
    return Said(what, "the other photos show the same boards from the other side", _AS_MADE)


@WORDS.finding(Code.MIRRORED, "by_lens", "or_turned")
def _mirrored_by_lens(case: str, images: Names) -> Said:
    how = "mirrored" if case == "by_lens" else "mirrored, or turned by 180°"
    what = f"{listed(images, 'photos')} {pick(images, 'is', 'are')} {how}: the lens's centre is on"
    return Said(f"{what} the other side of the middle", do=_AS_MADE)


@WORDS.finding(Code.OTHER_SIZE, "reduced")
def _reduced(
    width: int, height: int, given_width: int, given_height: int, x_px: float, y_px: float
) -> Said:
    return Said(
        f"all corners, and the lens's centre at ({x_px:.0f}, {y_px:.0f}), lie in the upper left of "
        f"{given_width}x{given_height} pixels: were the photos reduced?",
        f"a picture of about {width}x{height} would hold them",
        "give the size of the photos in which the corners were found",
    )


@WORDS.finding(Code.MIRRORED, "some_grids")
def _mirrored_some_grids(images: Names) -> Said:
    return Said(f"{listed(images, 'photos')} {pick(images, 'is', 'are')} mirrored", do=_AS_MADE)


@WORDS.finding(Code.MIRRORED, "colours", "colours_in_mirror")
def _mirrored_colours(case: str, board: str, first_square: Colour, other: str) -> Said:
    photos, mirror = "are mirrored", MIRROR
    if case == "colours_in_mirror":
        photos, mirror = "are not mirrored", f"if photos are not mirrored, {_NOT_MIRRORED}"
    return Said(
        f"board {board} is light where the target says dark: first_square is not "
        f"{first_square}, or photos {photos}",
        "seen in photos that show it whole; its corners are named by the colours seen",
        f"set first_square: {other} in target.yaml, or {mirror}; the lens does not depend on it",
    )


Printed = Literal[
    "inverted", "mirrored", "not_mirrored", "inverted_mirrored", "inverted_not_mirrored"
]


@WORDS.finding(Code.INVERTED)
@WORDS.finding(Code.MIRRORED, "markers")
def _markers_printed(
    boards: Names, printed: Printed, light: bool, first_square: Colour, corners: int
) -> Said:
    colours = f"are {pick(light, 'light on dark', 'dark on light')}"
    inverted = f"set inverted: {pick(light, 'true', 'false')} and first_square: {first_square} for "
    inverted += f"{pick(boards, 'it', 'them')} in target.yaml"
    mirrored = f"{_AS_MADE}, or {MIRROR}"
    seen: Mapping[Printed, tuple[str, str]] = {
        "inverted": (colours, inverted),
        "mirrored": ("are mirrored", mirrored),
        "not_mirrored": ("are not mirrored", _NOT_MIRRORED),
        "inverted_mirrored": (f"{colours} and are mirrored", f"{inverted}; {mirrored}"),
        "inverted_not_mirrored": (
            f"{colours} and are not mirrored",
            f"{inverted}; {_NOT_MIRRORED}",
        ),
    }
    how, do = seen[printed]
    return Said(
        f"the markers of {pick(boards, 'board', 'boards')} {listed(boards, 'boards')} {how}",
        f"read so, one photo shows {plural(corners, 'corner')}; read as the target says, none",
        do,
    )


Where = Literal["from", "in"]


def _where(where: Where, images: Names, rest: Names) -> str:
    if where == "from":
        return f"from {images[0]} on"
    return f"in {listed(images, 'photos')}, compared with {listed(rest, 'photos')}"


@WORDS.finding(Code.TWO_LENSES)
def _two_lenses(
    focal_off: float, x_px: float, y_px: float, where: Where, images: Names, rest: Names
) -> Said:
    off = f"{percent(focal_off)} and the centre by ({x_px:+.1f}, {y_px:+.1f}) px"
    what = f"photos of two cameras or zooms are mixed: the focal length differs by {off}"
    return Said(f"{what} {_where(where, images, rest)}", do="calibrate each camera separately")


@WORDS.finding(Code.ZOOM)
def _zoom(focal_off: float, where: Where, images: Names, rest: Names) -> Said:
    return Said(
        f"the focal length differs by {percent(focal_off)} {_where(where, images, rest)}: zoom or "
        "focus changed, or photos of two cameras are mixed",
        do="calibrate each setting and camera separately, with zoom and focus locked",
    )


@WORDS.finding(Code.SCALED)
def _scaled(scale: str, where: Where, images: Names, rest: Names) -> Said:
    what = f"photos seem scaled by {scale} {_where(where, images, rest)}"
    return Said(what, do="use all photos at their original size")


@WORDS.finding(Code.SHIFTED)
def _shifted(
    x_px: float, y_px: float, where: Where, images: Names, rest: Names, in_order: bool
) -> Said:
    why = (
        "the lens was bumped or moved, or photos from there on are from another camera or cropped"
        if in_order
        else "photos of two cameras of the same model are mixed, or some were cropped (a bumped "
        "lens would be off in all later photos)"
    )
    there = _where(where, images, rest)
    return Said(
        f"the lens's centre is off by ({x_px:+.1f}, {y_px:+.1f}) px {there}: {why}",
        do="calibrate these photos and the others separately, or use uncropped ones",
    )


@WORDS.finding(Code.TURNED)
def _turned(where: Where, images: Names, rest: Names) -> Said:
    what = f"the picture seems turned by 180° {_where(where, images, rest)}: the lens's centre is "
    do = "save the photos unrotated (EXIF rotation off), and calibrate again"
    return Said(f"{what}on the other side", do=do)


@WORDS.finding(Code.PHOTO_LENS)
def _photo_lens(images: Names, size_px: float, share: float, worst: str) -> Said:
    return Said(
        f"{listed(images, 'photos')} {pick(images, 'differs', 'differ')} from the other photos by "
        f"{size_px:.2f} px (RMS): different zoom, focus or cropping, or camera or target moved "
        "(rolling shutter)",
        f"this explains {whole(share)} of the squared error of {pick(images, 'it', worst)}",
        f"leave {pick(images, 'this photo', 'these photos')} out, and find out what was different",
    )


_ANEW: Mapping[str, tuple[str, str]] = {
    Code.BENT: (
        "the board bends differently in every photo",
        "glue it to a flat plate (glass, aluminium), and take the photos again",
    ),
    Code.PHOTO_LENS: (
        "camera or target moves while photos are taken (rolling shutter)",
        "hold both still for each photo; of a film, use frames in which nothing moves, not more of "
        "them",
    ),
    Code.ZOOM: (
        "the focal length changes from photo to photo (autofocus)",
        "switch autofocus off, and take the photos again",
    ),
    Code.SHIFTED: (
        "the lens's centre changes from photo to photo (image stabilisation)",
        "switch stabilisation off, and take the photos again",
    ),
}


@WORDS.finding(Code.BENT, "anew")
@WORDS.finding(Code.PHOTO_LENS, "anew")
@WORDS.finding(Code.ZOOM, "anew")
@WORDS.finding(Code.SHIFTED, "anew")
def _anew(code: str, images: Names, size_px: float, worst_px: float, share: float) -> Said:
    what, do = _ANEW[code]
    moves = f"this moves corners by {size_px:.2f} px (RMS), and by up to {worst_px:.2f} px in"
    explains = f"this explains {whole(share)} of the squared error beyond noise"
    return Said(f"{what}: {moves} {listed(images, 'photos')}", explains, do)


@WORDS.finding(Code.PHOTO_LENS, "left_out")
def _photo_lens_left_out(images: Names, others: int, noise_px: float) -> Said:
    them = pick(images, "it", "them")
    return Said(
        f"{listed(images, 'photos')} {pick(images, 'does', 'do')} not match the other "
        f"{plural(others, 'photo')}: another zoom or camera, cropping, or the target moved",
        f"without {them} the others fit to {noise_px:.2g} px",
        f"calibrate without {them}",
    )


@WORDS.finding(Code.REPEATS)
def _repeats(photos: int, distinct: int, repeats: Sequence[Names]) -> Said:
    return Said(
        near_duplicates(repeats),
        f"{plural(photos, 'photo')}, {distinct} different; the held-out error leaves "
        "near-duplicates out together",
        "take photos from other places instead",
    )


@WORDS.finding(Code.ONE_PLACE)
def _one_place(photos: int, near: float) -> Said:
    return Said(
        f"all {photos} photos were taken from nearly the same place, and show little more than one",
        f"in all of them the target lies in the same place of the picture, to {whole(near)} of its "
        "size",
        "take photos from different sides, near and far, tilted, with the target in every part of "
        "the picture",
    )
