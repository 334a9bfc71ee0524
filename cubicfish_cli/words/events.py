"""What is said while work is done, and what the command line calls the arguments of errors."""

from collections.abc import Mapping
from typing import Any, Literal

from cubicfish import Event
from cubicfish_cli.words.phrases import pick, plural
from cubicfish_cli.words.table import Words

WORDS = Words()
OPTIONS: Mapping[str, str] = {
    "overwrite": "--overwrite",
    "skip_existing": "--skip-existing",
    "image_size": "--size WxH",
    "max_angle_deg": "--max-angle",
    "jobs": "--jobs 1",
    "shots": "--shots",
    "tolerance": "--tolerance",
    "lift": "--lift ray",
    "kind": "--view",
    "size": "--size",
    "hfov_deg": "--hfov",
    "vfov_deg": "--hfov",
    "second_angle": "--hfov ...x",
    "both_angles": "--hfov 90x60",
    "focal": "--scale",
    "fit": "--fit",
    "rotate_deg": "--rotate",
    "plane": "'undistort --view plane:BOARD'",
}
"""What the command line calls the arguments that help against an error, by their names."""


@WORDS.event(Event.TARGET)
def _target(path: Any) -> str:
    return f"Target: {path}."


@WORDS.event(Event.CAMERA)
def _camera(name: str, path: Any) -> str:
    return f"Camera {name}: {path}."


@WORDS.event(Event.PASSED_OVER)
def _passed_over(line: str) -> str:
    return line


@WORDS.event(Event.MANY_PHOTOS)
def _many_photos(photos: int) -> str:
    return f"{plural(photos, 'photo')}: --most 60 calibrates from the 60 most useful."


@WORDS.event(Event.PHOTOS_CHOSEN)
def _photos_chosen(chosen: int, photos: int, ended: str) -> str:
    return f"Chose the {chosen:,} most useful of {plural(photos, 'photo')} ({ended})."


@WORDS.event(Event.FILM_ENDS)
def _film_ends(problem: str) -> str:
    return f"warning: {problem}"


@WORDS.event(Event.FILM_DAMAGED)
def _film_damaged(film: str, frames: int, of: int) -> str:
    decoded = f"{frames:,} of its {plural(of, 'frame')} can be decoded, and these are used"
    return f"warning: {film} is damaged or cut short: {decoded}; copy the file again if you can"


@WORDS.event(Event.FILM_TURNED)
def _film_turned(film: str, turned_deg: int) -> str:
    return f"note: {film} has a rotation flag of {turned_deg}°, which is ignored"


@WORDS.event(Event.FRAMES_CHOSEN)
def _frames_chosen(chosen: int, frames: int, folder: Any, ended: str) -> str:
    return f"Chose {chosen:,} of {plural(frames, 'frame')}: {folder} ({ended})."


def why_ended(ended: Literal["all", "asked", "enough"], chosen: int, what: str) -> str:
    """Return why no more pictures were chosen; ``what`` one of them is called."""
    some = f"{chosen} {what}{pick(chosen, '', 's')}"
    return {
        "all": pick(chosen, f"the only usable {what}", f"all {chosen} usable {what}s"),
        "asked": f"{some}: as many as were asked for",
        "enough": f"{some}: one more would add less than 1 % of what is wanted",
    }[ended]


@WORDS.event(Event.LOOKING)
def _looking(photos: int) -> str:
    return f"Looking for corners in {plural(photos, 'photo')}."


@WORDS.event(Event.LOOKED_AGAIN)
def _looked_again(corners: int) -> str:
    return f"{plural(corners, 'more corner')} found with the fitted camera."


@WORDS.event(Event.NOT_CERTAIN)
def _not_certain(photos: int) -> str:
    return (
        f"{plural(photos, 'photo')} {pick(photos, 'shows', 'show')} too little of the board to "
        "tell which corners these are: used for the lens, but not to measure the target."
    )


@WORDS.event(Event.FITTING)
def _fitting(corners: int, points: bool = False) -> str:
    return f"Fitting to {plural(corners, 'point' if points else 'corner')}."


@WORDS.event(Event.NO_MAP)
def _no_map(width: int, height: int) -> str:
    return (
        f"No undistort_map.npz was written: a map of {width}x{height} pixels takes gigabytes. "
        "'cubicfish map --size' makes a smaller one."
    )


@WORDS.event(Event.PRINTED_AS_DRAWN)
def _printed_as_drawn() -> str:
    return "note: boards are printed as drawn, without the deviations that a calibration measured"


@WORDS.event(Event.AMBIGUOUS)
def _ambiguous(line: str) -> str:
    return f"note: {line}"


@WORDS.event(Event.WITHOUT_POSE)
def _without_pose(photos: int) -> str:
    return f"Looking for corners in {plural(photos, 'photo')} without a known pose."


@WORDS.event(Event.VIDEO_TURNED)
def _video_turned(video: Any, turned_deg: int) -> str:
    turned = f"{video}: the source has a rotation flag of {turned_deg}°"
    return f"{turned}, which the result lacks: rotate it with --rotate 0,0,DEG"


@WORDS.event(Event.VIDEO_INTERLACED)
def _video_interlaced(video: Any) -> str:
    return (
        f"{video}: the source is interlaced, and the result mixes both fields: deinterlace it "
        "first (ffmpeg -vf yadif)"
    )


@WORDS.event(Event.VIDEO_REDUCED)
def _video_reduced(video: Any, given: str, written: str) -> str:
    return f"{video}: pictures of {given} are written as {written}, which holds less"


@WORDS.event(Event.RESCALED)
def _rescaled(photo: Any, size: str, calibrated: str, times: float, enlarged: bool) -> str:
    return (
        f"note: {photo} has {size} pixels, {times:.3g} times the size of the calibrated photos "
        f"({calibrated}): taken as {pick(enlarged, 'an enlarged', 'a reduced')} photo of the same "
        "camera"
    )


@WORDS.event(Event.RENDERED_FLAT)
def _rendered_flat() -> str:
    return "Boards are rendered flat, without the target's bends and offsets."


@WORDS.event(Event.RENDERING)
def _rendering(pictures: str, width: int, height: int) -> str:
    return f"Rendering {pictures} of {width}x{height} pixels."
