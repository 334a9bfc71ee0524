"""Photos in which corners are looked for, and grids that were found in them."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from cubicfish import listed
from cubicfish.judge import Code
from cubicfish.judge import FindingText as Said
from cubicfish_cli.words.phrases import pick, plural
from cubicfish_cli.words.set_up import COUNTS, MIRROR
from cubicfish_cli.words.table import Words

Names = Sequence[str]

_IN_VIEW = "is a board in view, with whole squares, sharp and uncovered?"
_FOCUS = "focus, and hold the camera still"
_COVERED = "is the board covered, shaded or bent, or are its squares not square?"
_BY_ITSELF = "calibrate each size separately"
_MARKERS_LARGE = "are markers at least about 15 pixels wide, and sharp?"
_LAID_OUT = (
    "are corners (or tags), first_square and first_marker of the boards right, and markers at "
    "least about 15 pixels wide?"
)
_MARKERS_HERE = (
    "are dictionary (or family) and first_marker right, and are markers at least about 15 pixels "
    "wide?"
)
WORDS = Words(
    findings={
        (Code.NO_MARKERS, ""): Said(
            "squares were found but none of the target's markers", do=_MARKERS_HERE
        ),
        (Code.NO_PHOTO, ""): Said("no photo was given", do="name photos or the folder they are in"),
    }
)
SeenAt = Literal["full", "half", "quarter", "eighth", "sixteenth", "less"]
_SEEN_AT: Mapping[SeenAt, str] = {
    "full": "full size",
    "half": "half the size",
    "quarter": "a quarter of the size",
    "eighth": "an eighth of the size",
    "sixteenth": "a sixteenth of the size",
    "less": "a small part of the size",
}


def _many(left_out: int, photos: int) -> str:
    return f"{left_out} of the {photos} photos in which boards were found are left out:"


@WORDS.finding(Code.CANNOT_BE_READ)
@WORDS.finding(Code.FAILED)
def _problem_alone(problem: str) -> Said:
    return Said(problem)


@WORDS.finding(Code.OTHER_SIZE, "", "turned")
def _other_size(case: str, width: int, height: int, most_width: int, most_height: int) -> Said:
    what = f"{width}x{height} pixels, while most photos are {most_width}x{most_height}"
    if case != "turned":
        return Said(f"{what}: {_BY_ITSELF}")
    return Said(
        f"{what}: the same size turned by 90° (portrait and landscape)",
        do="EXIF rotation is ignored: save the photos unrotated, or calibrate these separately",
    )


@WORDS.finding(Code.OTHER_SIZE, "copy")
def _copy(images: Names, width: int, height: int, most_width: int, most_height: int) -> Said:
    has, kind = pick(images, "has", "have"), pick(images, "a reduced photo", "reduced photos")
    if width > most_width:
        kind = pick(images, "an enlarged photo", "enlarged photos")
    return Said(
        f"{listed(images, 'photos')} {has} {width}x{height} pixels, while most photos have "
        f"{most_width}x{most_height}: taken as {kind} of the same camera",
        do=f"--exclude {pick(images, 'it', 'them')} if the camera was set to another mode, crop "
        "or zoom",
    )


@WORDS.finding(Code.OTHER_SIZE, "many")
def _other_size_of_many(left_out: int, photos: int, most_width: int, most_height: int) -> Said:
    size = f"{most_width}x{most_height} pixels"
    return Said(f"{_many(left_out, photos)} they are not {size}", do=_BY_ITSELF)


def _no_board(seen: str, do: str, photos: int) -> Said:
    """Of several photos their number stands before it, and what they do not show."""
    return Said(seen if photos else f"no checkerboard found: {seen}", do=do)


_SEEN: Mapping[tuple[str, str], tuple[str, str]] = {
    (Code.TOO_DARK, ""): ("too dark", "use a longer exposure"),
    (Code.TOO_BRIGHT, ""): ("too bright (overexposed)", "use a shorter exposure"),
    (Code.TOO_BRIGHT, "burnt"): (
        "too bright (white is burnt out, and dark squares no longer touch)",
        "use a shorter exposure",
    ),
    (Code.NO_PATTERN, ""): ("a uniform picture without any pattern", _IN_VIEW),
    (Code.LOW_CONTRAST, ""): ("too little contrast for the noise", "light the boards better"),
    (Code.NO_CORNER, ""): ("no checkerboard corner in sight", _IN_VIEW),
    (Code.BLURRED, ""): ("too blurred (out of focus, or motion)", _FOCUS),
    (Code.NO_CHECKERBOARD, ""): ("corner-like points, but no checkerboard pattern", _IN_VIEW),
}
"""What photos look like in which no grid was found, and what to do."""


def _nothing_found(code: str, case: str, photos: int = 0) -> Said:
    return _no_board(*_SEEN[code, case], photos)


for _code, _case in _SEEN:
    WORDS.finding(_code, _case)(_nothing_found)


@WORDS.finding(Code.PHOTO_TOO_SMALL)
def _photo_too_small(width: int, height: int, photos: int = 0) -> Said:
    do = "use the photo as the camera made it"
    return _no_board(f"photo too small ({width}x{height})", do, photos)


@WORDS.finding(Code.BLURRED, "grid")
def _blurred_grid(
    columns: int, rows: int, seen_at: SeenAt, side_px: float, blur_px: float, photos: int = 0
) -> Said:
    grid = f"a grid of about {columns}x{rows} corners shows at {_SEEN_AT[seen_at]}"
    seen = f"{grid}, with squares of {side_px:.0f} px blurred by {blur_px:.0f} px"
    return _no_board(seen, _FOCUS, photos)


@WORDS.finding(Code.SQUARES_TOO_SMALL)
def _squares_too_small(side_px: float, seen_at: SeenAt, least_px: int, photos: int = 0) -> Said:
    size = f"{side_px:.1f} px, seen at {_SEEN_AT[seen_at]}; they must be {least_px} px or more"
    return _no_board(f"squares too small ({size})", "go nearer, or use larger squares", photos)


@WORDS.finding(Code.NO_CHECKERBOARD, "grid")
def _no_checkerboard_grid(columns: int, rows: int, seen_at: SeenAt, photos: int = 0) -> Said:
    grid = f"a grid of about {columns}x{rows} corners shows at {_SEEN_AT[seen_at]}"
    return _no_board(f"{grid}, too unclear to be read", _COVERED, photos)


@WORDS.finding(Code.DOTS)
def _dots(dots: int, photos: int = 0) -> Said:
    do = (
        "cubicfish reads checkerboards, ChArUco and AprilGrids: photograph one of these, or bring "
        "the dots' centres as corners.csv"
    )
    return _no_board(f"a grid of about {dots} dots", do, photos)


@WORDS.finding(Code.NO_MARKERS, "unplaced")
def _unplaced_markers(markers: int) -> Said:
    if markers == 1:
        return Said("only one of the target's markers was read", do=_MARKERS_LARGE)
    return Said(
        f"{markers} of the target's markers were read, and do not agree on where the board is",
        do=_LAID_OUT,
    )


@WORDS.finding(Code.NO_MARKERS, "unplaced_in_all")
def _unplaced_markers_in_all(says: str, photos: int, markers: int) -> Said:
    return Said(
        f"{markers} of the target's markers ({says}) were read in {plural(photos, 'photo')}, and "
        "do not agree on where the board is",
        do=_LAID_OUT,
    )


@WORDS.finding(Code.NO_MARKERS, "many")
def _no_markers_in_many(left_out: int, photos: int) -> Said:
    what = "squares were found, but too few of the target's markers or none"
    return Said(f"{_many(left_out, photos)} {what}", do=_MARKERS_HERE)


@WORDS.finding(Code.NO_MARKERS, "all")
def _no_markers_at_all(says: str, photos: int) -> Said:
    return Said(
        f"none of the target's markers ({says}) was found in {plural(photos, 'photo')}",
        do="check dictionary (or family) and first_marker of the boards, and that photos are sharp "
        "and not mirrored",
    )


@WORDS.finding(Code.NO_MARKERS, "others")
def _no_markers_but_others(says: str, photos: int, first: int, last: int, seen: str) -> Said:
    found = f"none of the target's markers ({says}) was found in {plural(photos, 'photo')}"
    return Said(
        f"{found}, which show markers {first} to {last} of {seen}",
        do="correct dictionary (or family) and first_marker of the boards in target.yaml",
    )


@WORDS.finding(Code.TWICE_IN_VIEW)
def _twice_in_view(board: str) -> Said:
    return Said(
        f"board {board} is left out: its markers appear in two places: two copies of it are in "
        "view, or it differs from target.yaml"
    )


def _grid(grids: int, columns: int, rows: int, corners: int) -> str:
    if grids == 1:
        return f"a grid of {columns}x{rows} with {corners} corners"
    return f"{grids} grids of up to {columns}x{rows} corners"


@WORDS.finding(Code.BY_CONVENTION)
def _by_convention(grids: int, columns: int, rows: int, corners: int) -> Said:
    placed = pick(grids, "it is placed in the board's middle", "each is placed in its middle")
    return Said(
        f"{_grid(grids, columns, rows, corners)} may show only part of the board; {placed}",
        do="this does not matter for the lens, only for measuring the board",
    )


@WORDS.finding(Code.BY_CONVENTION, "whole")
def _whole_by_convention(grids: int, columns: int, rows: int, corners: int) -> Said:
    what = "a weak line at the rim of"
    if grids > 1:
        what = "weak lines at the rims of"
    return Said(
        f"{what} {_grid(grids, columns, rows, corners)} may not be the board's",
        do="this does not matter for the lens, only for measuring the board",
    )


class _Grid(NamedTuple):
    """What is said of a grid that has no place: of one, where most photos have it, what to do."""

    why: str
    many: str
    do: str
    short: str


_CHECK_BOARDS = "check corners, square, origin and axes of the boards in target.yaml"
_MORE_BOARDS = "take photos that show two boards, or the ends of a board"
_GRIDS: Mapping[str, _Grid] = {
    Code.AMBIGUOUS: _Grid(
        why="several places on the target fit nearly as well",
        many="several places on the target fit nearly as well",
        do=_MORE_BOARDS,
        short="several places fit",
    ),
    Code.SLIDES: _Grid(
        why="no end of the board is visible, so the place along it is unknown",
        many="no end of the board is visible, so the place along it is unknown",
        do=_MORE_BOARDS,
        short="no end of a board in view",
    ),
    Code.LOOKS_LIKE_ANOTHER: _Grid(
        why="it could be any of several boards that look alike",
        many="each could be any of several boards that look alike",
        do="take photos that show these boards together",
        short="one of several boards alike",
    ),
    Code.FITS_NOWHERE: _Grid(
        why="it fits nowhere on the target",
        many="what they show fits nowhere on the target",
        do=_CHECK_BOARDS,
        short="fits nowhere",
    ),
    Code.TOO_LARGE: _Grid(
        why="it is larger than any board of the target",
        many="they show grids of {seen} inner corners, larger than any board of the target",
        do=f"if it is a board of the target, correct {COUNTS}",
        short="larger than any board",
    ),
    Code.OTHER_COLOURS: _Grid(
        why="squares are light where those of the board are dark",
        many="squares are light where those of the board are dark",
        do="check first_square of the boards in target.yaml, and whether the photo is mirrored; "
        + MIRROR,
        short="light where the board is dark",
    ),
    Code.NO_PLANE: _Grid(
        why="the corners do not form a flat grid of squares",
        many="the corners do not form a flat grid of squares",
        do=_CHECK_BOARDS,
        short="not a flat grid of squares",
    ),
}


_OF_SEVERAL: Mapping[str, str] = {
    Code.FITS_NOWHERE: "they fit nowhere on the target",
    Code.TOO_LARGE: "they are larger than any board of the target",
    Code.LOOKS_LIKE_ANOTHER: "each could be any of several boards that look alike",
}


def _grid_left_out(code: str, grids: int, columns: int, rows: int, corners: int) -> Said:
    why = _GRIDS[code].why
    if grids != 1:
        why = _OF_SEVERAL.get(code, why)
    grid = _grid(grids, columns, rows, corners)
    return Said(f"{grid} {pick(grids, 'is', 'are')} left out: {why}", do=_GRIDS[code].do)


def _left_out_in_many(code: str, left_out: int, photos: int, seen: str = "") -> Said:
    many = _GRIDS[code].many.format(seen=seen)
    return Said(f"{_many(left_out, photos)} {many}", do=_GRIDS[code].do)


for _code, _own in _GRIDS.items():
    WORDS.finding(_code)(_grid_left_out)
    WORDS.finding(_code, "many")(_left_out_in_many)
    WORDS.findings[_code, "short"] = Said(_own.short)


@WORDS.finding(Code.FITS_NOWHERE, "odd")
@WORDS.finding(Code.NO_PLANE, "odd")
def _odd_grid(code: str, grids: int, columns: int, rows: int, corners: int) -> Said:
    though = "those of most photos do" if code == Code.NO_PLANE else "grids of most photos do"
    what = _grid_left_out(code, grids, columns, rows, corners).what
    return Said(
        f"{what}, though {though}",
        do="leave the photo out if it is of another camera or board, or was cropped, scaled, "
        "turned or mirrored",
    )


Why = Literal[
    "ambiguous", "slides", "looks_like_another", "fits_nowhere", "too_large", "other_colours",
    "no_plane",
]  # fmt: skip


@WORDS.finding(Code.NOTHING_NAMED)
def _nothing_named(grids: int, columns: int, rows: int, photos: int, says: str, why: Why) -> Said:
    found = f"found {plural(grids, 'grid')} of up to {columns}x{rows} inner corners in "
    found += f"{plural(photos, 'photo')}, but none can be placed on the target ({says})"
    return Said(found, do=f"{_OF_SEVERAL.get(why, _GRIDS[why].why)}; {_GRIDS[why].do}")


@WORDS.finding(Code.NO_PHOTO, "none_usable")
def _no_usable_photo(first: Said) -> Said:
    return Said(f"no photo can be used: {first.line}")


@WORDS.finding(Code.NO_PHOTO, "several")
def _no_usable_photo_of_several(first: Said, more: int) -> Said:
    return Said(f"no photo can be used: {first.line} (and {more} more that cannot be used)")


@WORDS.finding(Code.ANOTHER_TARGET)
def _another_target(boards: Names, photos: int, seen: str, says: str) -> Said:
    size = f"{pick(boards, 'one board', 'boards')} of another size"
    shown = (
        f"{plural(photos, 'photo')} {pick(photos, 'shows', 'show')} grids of {seen} inner corners"
    )
    return Said(
        f"{shown}, but the target has {size} ({says})",
        do="give the target that the photos show, or count corners where four squares meet and "
        f"correct {COUNTS}",
    )
