"""Rigs in words: what is said of several cameras on one body, and of their films."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from cubicfish import Event, Rig, listed
from cubicfish.judge import Code
from cubicfish.judge import FindingText as Said
from cubicfish_cli.words.phrases import near_duplicates, pick, plural, whole
from cubicfish_cli.words.sentences import with_text, with_texts
from cubicfish_cli.words.table import Words

WORDS = Words()
Names = Sequence[str]

_HOLD_STILL = (
    "hold rig and target still for a second at each shot, or trigger the cameras together; if "
    "there are films, give the films themselves, so that their clock offset is fitted"
)


def rig_with_texts(rig: Rig) -> Rig:
    """A rig with the sentences of all its findings, as its files have them."""
    return replace(
        rig,
        fit=replace(rig.fit, findings=tuple(map(with_text, rig.fit.findings))),
        cameras=tuple(replace(one, fit=with_texts(one.fit)) for one in rig.cameras),
    )


def _either(cameras: Names, case: str) -> str:
    return f"camera {cameras[0]} or {cameras[1]}" if case == "either" else f"camera {cameras[0]}"


def _all(cameras: Names) -> str:
    return f"{pick(cameras, 'camera', 'cameras')} {listed(cameras, 'cameras')}"


@WORDS.finding(Code.SHOT_MISMATCHED)
def _shot_mismatched(cameras: Names, of_shots: Names, off_px: float) -> Said:
    return Said(
        f"{of_shots[0]} of camera {cameras[0]} does not belong to the shot it is matched to, and "
        "was used as a shot of its own",
        f"its corners are {off_px:.0f} px off there, but fit alone",
        "correct the match, or leave it out",
    )


Part = Literal["before", "after", "none"]


@WORDS.finding(Code.CAMERA_MOVED, "", "either")
def _camera_moved(
    case: str,
    cameras: Names,
    of_shots: Names,
    shift: float,
    units: str,
    turn_deg: float,
    part: Part,
    photos: int,
) -> Said:
    several = f"{plural(photos, 'photo')} {pick(photos, 'does', 'do')} not count for it"
    given: Mapping[Part, str] = {
        "before": f"that after the move; the earlier {several}",
        "after": f"that before the move; the later {several}",
        "none": "the mean over all shots; two places fit hardly better",
    }
    return Said(
        f"{_either(cameras, case)} moved on the body by {shift:.2g} {units} and {turn_deg:.2g}° "
        f"about shot {of_shots[0]}",
        f"the place given is {given[part]}",
        "fasten it, and take the shots again if it has moved since",
    )


@WORDS.finding(Code.CLOCKS_DIFFER, "", "ahead")
def _clocks_differ(
    case: str, cameras: Names, late_ms: float, sigma_ms: float, effect_px: float
) -> Said:
    apart = f"{late_ms:.1f} ± {sigma_ms:.1f} ms {'earlier' if case == 'ahead' else 'later'}"
    return Said(
        f"camera {cameras[0]} is {apart} than {cameras[1]}; this is corrected (uncorrected it "
        f"would shift its corners by {effect_px:.2g} px)",
        do="trigger the cameras together if they must see the same moment",
    )


@WORDS.finding(Code.NOT_AT_ONCE, "", "either")
def _not_at_once(case: str, cameras: Names, off_px: float) -> Said:
    off = f"it is {off_px:.2g} px off, but fits alone"
    if case == "either":
        off = f"they are {off_px:.2g} px apart, but each fits alone"
    return Said(
        f"{_either(cameras, case)} is out of sync with the others: the cameras are not triggered "
        "together, their clocks differ, or shots are mismatched",
        f"in a typical shot {off}",
        _HOLD_STILL,
    )


@WORDS.finding(Code.NOT_AT_ONCE, "fitted")
def _photos_at_own_times(cameras: Names, off_px: float) -> Said:
    return Said(
        f"{_all(cameras)} {pick(cameras, 'is', 'are')} not exactly in sync: this shifts corners by "
        f"{off_px:.2g} px, so a time is fitted for each photo",
        do="hold the board still for a second at each place, or trigger the cameras together",
    )


@WORDS.finding(Code.SHOT_APART, "", "either")
def _shot_apart(case: str, cameras: Names, of_shots: Names, off_px: float) -> Said:
    who = f"cameras {listed(cameras, '')}" if case == "either" else f"camera {cameras[0]}"
    return Said(
        f"{who} {pick(cameras, 'does', 'do')} not match the rest of shot {of_shots[0]} "
        f"({off_px:.2g} px off, far more than in other shots)",
        do="leave that shot out if something moved in it, or its photos are of different moments",
    )


@WORDS.finding(Code.RIG_STRAINED)
def _rig_strained(cameras: Names, rms_px: float, alone_px: float) -> Said:
    off = f"{pick(cameras, '', 'up to ')}{rms_px:.2f} px as a rig"
    alone = f"{alone_px:.2f} px {pick(cameras, 'alone', 'individually')}"
    return Said(
        f"{_all(cameras)} {pick(cameras, 'is', 'are')} off by {off}, {alone}",
        do="check that nothing moves on the body, that photos of a shot were taken at the same "
        "moment, and that the target is rigid",
    )


@WORDS.finding(Code.PLACE_UNCERTAIN)
def _place_uncertain(cameras: Names, shift: float, units: str, turn_deg: float) -> Said:
    return Said(
        f"{_all(cameras)} {pick(cameras, 'is', 'are')} placed on the body only to within "
        f"{shift:.2g} {units} and {turn_deg:.2g}°",
        do=f"take more shots in which {pick(cameras, 'it', 'one of these')} and another camera see "
        "boards all over their fields",
    )


@WORDS.finding(Code.FEW_COMMON_SHOTS)
def _few_common_shots(cameras: Names, shots: float, wanted: float) -> Said:
    return Said(
        f"camera {cameras[0]} shares only {plural(shots, 'shot')} with the others",
        do=f"take {wanted:.0f} or more in which {cameras[0]} and {cameras[1]} both see boards of "
        "the target",
    )


@WORDS.finding(Code.REPEATS, "shots")
def _repeated_shots(shots: int, distinct: int, repeats: Sequence[Names]) -> Said:
    return Said(
        f"shot {near_duplicates(repeats)}",
        f"{plural(shots, 'shot')}, {distinct} different; the held-out error leaves near-duplicates "
        "out together",
        "move the rig or the target between shots; of a recording take fewer",
    )


@WORDS.finding(Code.ONE_PLACE, "shots")
def _one_place(shots: int, near: float) -> Said:
    return Said(
        f"all {shots} shots show the target from nearly the same place, and little more than one",
        f"in all of them it lies in the same place of the picture, to {whole(near)} of its size",
        "take shots from different sides, near and far, tilted",
    )


@WORDS.event(Event.MOMENTS)
def _moments(moments: int) -> str:
    return f"Searching {plural(moments, 'moment')} of the films for boards."


@WORDS.event(Event.SHOTS_CHOSEN)
def _shots_chosen(chosen: int, shots: int, ended: str) -> str:
    return f"Chose the {chosen} most useful of {plural(shots, 'shot')} ({ended})."


@WORDS.event(Event.CLOCK)
def _clock(name: str, by_ms: float, ahead: bool, first: str) -> str:
    way = pick(ahead, "ahead of", "behind")
    return (
        f"note: the clock of {name} is {by_ms:.1f} ms {way} that of {first}, judged by when they "
        "move (to about a frame); this is corrected."
    )


@WORDS.event(Event.CLOCK_UNSURE)
def _clock_unsure(name: str, first: str, apart_s: float) -> str:
    return (
        f"note: the clock offset between {name} and {first} is not known: both films move in a "
        f"steady rhythm that repeats after {apart_s:.1f} s. Clocks are used as they are; if they "
        "differ, film again with pauses of different lengths."
    )


@WORDS.event(Event.MEASURED_AS_DRAWN)
def _measured_as_drawn(refined: Any) -> str:
    return (
        "note: the rig was fitted to the refined target, and errors on the drawn one are larger: "
        f"'--target {refined}' measures the rig alone."
    )
