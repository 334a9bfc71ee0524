"""Codes, severities and remedies of findings."""

from collections.abc import Mapping
from enum import StrEnum


class Severity(StrEnum):
    """What a finding says about the camera: nothing against it, to be used with care, or wrong."""

    NOTE = "note"
    CARE = "care"
    BAD = "bad"


class Remedy(StrEnum):
    """What helps against a finding."""

    CORRECT_TARGET = "correct_target"
    CORRECT_PHOTOS = "correct_photos"
    SEPARATE_PHOTOS = "separate_photos"
    LEAVE_OUT = "leave_out"
    TAKE_PHOTOS = "take_photos"
    TAKE_AGAIN = "take_again"
    HOLD_STILL = "hold_still"
    CALIBRATE_AGAIN = "calibrate_again"
    CHECK = "check"
    NOTHING = "nothing"


class Code(StrEnum):
    """The codes of the library's findings; others may bring their own, which are text too."""

    UNKNOWN = "unknown"  # of which a file has nothing but the sentence
    # About a set-up: why corners do not fit as they should.
    BOARD_ORDER = "board_order"
    BOARD_NAMES = "board_names"
    BOARD_PLACE = "board_place"
    BOARD_SQUARE = "board_square"
    CORNER_NAMES = "corner_names"
    CORNER_COUNT = "corner_count"
    MIRRORED = "mirrored"
    INVERTED = "inverted"
    TWO_LENSES = "two_lenses"
    ZOOM = "zoom"
    SCALED = "scaled"
    SHIFTED = "shifted"
    TURNED = "turned"
    PHOTO_LENS = "photo_lens"
    REPEATS = "repeats"
    ONE_PLACE = "one_place"
    # About a fit: what is against the camera.
    NO_FIGURES = "no_figures"
    LARGE_ERRORS = "large_errors"
    FEW_CORNERS = "few_corners"
    NOT_HELD_OUT = "not_held_out"
    OVERFITTED = "overfitted"
    RADIAL_IS_NEARER = "radial_is_nearer"
    FEW_PHOTOS_OF_A_PLANE = "few_photos_of_a_plane"
    WORSE_AT_THE_RIM = "worse_at_the_rim"
    EXTRAPOLATED = "extrapolated"
    LOW_COVERAGE = "low_coverage"
    SMALL_FIELD = "small_field"
    LOW_RANK = "low_rank"
    UNCERTAIN = "uncertain"
    MANY_OUTLIERS = "many_outliers"
    MANY_UNFIT = "many_unfit"
    A_FEW_FAR_OFF = "a_few_far_off"
    WORSE_THAN_BEFORE = "worse_than_before"
    # About a fitted board: it departs by more than paper or plate explains.
    BENT = "bent"
    STRETCHED = "stretched"
    MOVED = "moved"
    CORNERS_OFF = "corners_off"
    # About the photos so far: why they are not enough, and what cannot be said about the next.
    NOT_CERTAIN = "not_certain"
    NOT_TRUSTED = "not_trusted"
    MIDDLE_UNSEEN = "middle_unseen"
    NO_POSES = "no_poses"
    NO_TARGET = "no_target"
    NO_SIDE = "no_side"
    NO_VIEW = "no_view"
    # About photos in a fit.
    TOO_FEW_CORNERS = "too_few_corners"
    DOES_NOT_FIT = "does_not_fit"
    NOISY = "noisy"
    BOARD_DROPPED = "board_dropped"
    STANDS_OUT = "stands_out"
    NO_ERROR = "no_error"
    OUTLIERS = "outliers"
    # About photos in which corners are searched.
    CANNOT_BE_READ = "cannot_be_read"
    OTHER_SIZE = "other_size"
    PHOTO_TOO_SMALL = "photo_too_small"
    TOO_DARK = "too_dark"
    TOO_BRIGHT = "too_bright"
    NO_PATTERN = "no_pattern"
    LOW_CONTRAST = "low_contrast"
    NO_CORNER = "no_corner"
    BLURRED = "blurred"
    SQUARES_TOO_SMALL = "squares_too_small"
    NO_CHECKERBOARD = "no_checkerboard"
    DOTS = "dots"
    NO_MARKERS = "no_markers"
    TWICE_IN_VIEW = "twice_in_view"
    # About grids that were found in them.
    BY_CONVENTION = "by_convention"
    AMBIGUOUS = "ambiguous"
    SLIDES = "slides"
    LOOKS_LIKE_ANOTHER = "looks_like_another"
    FITS_NOWHERE = "fits_nowhere"
    TOO_LARGE = "too_large"
    OTHER_COLOURS = "other_colours"
    NO_PLANE = "no_plane"
    # Why no photo could be used.
    NOTHING_NAMED = "nothing_named"
    NO_PHOTO = "no_photo"
    ANOTHER_TARGET = "another_target"
    # About a rig's shots.
    SHOT_MISMATCHED = "shot_mismatched"
    CAMERA_MOVED = "camera_moved"
    FEW_COMMON_SHOTS = "few_common_shots"
    CLOCKS_DIFFER = "clocks_differ"
    NOT_AT_ONCE = "not_at_once"
    SHOT_APART = "shot_apart"
    RIG_STRAINED = "rig_strained"
    PLACE_UNCERTAIN = "place_uncertain"
    # Why a photo could not be undistorted.
    FAILED = "failed"


_REMEDIES: Mapping[Remedy, tuple[str | tuple[str, str], ...]] = {
    Remedy.CORRECT_TARGET: (
        Code.BOARD_ORDER,
        Code.BOARD_NAMES,
        Code.BOARD_PLACE,
        Code.BOARD_SQUARE,
        Code.CORNER_NAMES,
        Code.CORNER_COUNT,
        (Code.MIRRORED, "none"),
        (Code.MIRRORED, "colours"),
        (Code.MIRRORED, "colours_in_mirror"),
        Code.INVERTED,
        Code.LARGE_ERRORS,
        (Code.LOW_RANK, "point"),
        Code.BENT,
        Code.STRETCHED,
        Code.MOVED,
        Code.CORNERS_OFF,
        Code.NO_MARKERS,
        Code.FITS_NOWHERE,
        Code.TOO_LARGE,
        Code.OTHER_COLOURS,
        Code.NO_PLANE,
        Code.NOTHING_NAMED,
        Code.ANOTHER_TARGET,
    ),
    Remedy.CORRECT_PHOTOS: (
        Code.MIRRORED,
        Code.SCALED,
        Code.TURNED,
        (Code.OTHER_SIZE, "turned"),
        (Code.NO_PHOTO, "none_usable"),
        (Code.NO_PHOTO, "several"),
        Code.SHOT_MISMATCHED,
    ),
    Remedy.SEPARATE_PHOTOS: (
        Code.TWO_LENSES,
        Code.ZOOM,
        Code.SHIFTED,
        Code.PHOTO_LENS,
        Code.OTHER_SIZE,
        Code.CAMERA_MOVED,
        Code.SHOT_APART,
    ),
    Remedy.TAKE_PHOTOS: (
        Code.REPEATS,
        Code.ONE_PLACE,
        Code.FEW_CORNERS,
        (Code.NOT_HELD_OUT, "few"),
        Code.OVERFITTED,
        Code.RADIAL_IS_NEARER,
        Code.FEW_PHOTOS_OF_A_PLANE,
        Code.WORSE_AT_THE_RIM,
        Code.EXTRAPOLATED,
        Code.LOW_COVERAGE,
        Code.SMALL_FIELD,
        Code.LOW_RANK,
        Code.UNCERTAIN,
        Code.NOT_CERTAIN,
        Code.MIDDLE_UNSEEN,
        Code.AMBIGUOUS,
        Code.SLIDES,
        Code.LOOKS_LIKE_ANOTHER,
        Code.PLACE_UNCERTAIN,
        (Code.BOARD_PLACE, "not_found"),
        Code.FEW_COMMON_SHOTS,
    ),
    Remedy.CALIBRATE_AGAIN: (
        Code.NO_FIGURES,
        Code.NOT_HELD_OUT,
        Code.NO_POSES,
        Code.WORSE_THAN_BEFORE,
    ),
    Remedy.CHECK: (
        (Code.NO_FIGURES, "elsewhere"),
        (Code.LARGE_ERRORS, "evaluation"),
        (Code.LARGE_ERRORS, "photo"),
    ),
    Remedy.NOTHING: (
        (Code.BOARD_PLACE, "found"),
        Code.NO_TARGET,
        Code.NO_SIDE,
        Code.NO_VIEW,
        Code.BY_CONVENTION,
        Code.CLOCKS_DIFFER,
    ),
    Remedy.TAKE_AGAIN: (
        Code.MANY_UNFIT,
        Code.TOO_FEW_CORNERS,
        Code.NOISY,
        Code.NO_ERROR,
        Code.PHOTO_TOO_SMALL,
        Code.TOO_DARK,
        Code.TOO_BRIGHT,
        Code.NO_PATTERN,
        Code.LOW_CONTRAST,
        Code.NO_CORNER,
        Code.BLURRED,
        Code.SQUARES_TOO_SMALL,
        Code.NO_CHECKERBOARD,
        Code.DOTS,
    ),
    Remedy.LEAVE_OUT: (
        Code.CANNOT_BE_READ,
        (Code.FITS_NOWHERE, "odd"),
        (Code.NO_PLANE, "odd"),
    ),
    Remedy.HOLD_STILL: (Code.NOT_AT_ONCE,),
}
_REMEDY_OF = {what: remedy for remedy, own in _REMEDIES.items() for what in own}


def remedy_of(code: str, case: str = "") -> Remedy:
    """What helps against a finding of a code and a case of it; where none is known, to look."""
    return _REMEDY_OF.get((code, case)) or _REMEDY_OF.get(code, Remedy.CHECK)
