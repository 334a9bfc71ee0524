"""What is said while photos are taken: what is wrong with one, and how far the shoot is."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path

from cubicfish import Target, Verdict, shown
from cubicfish_cli.commands.target import check_target, print_size
from cubicfish_cli.extensions.shoot.guidance import Guidance
from cubicfish_cli.words.phrases import plural


class Flaw(StrEnum):
    """What is wrong with a photo that shows the target."""

    BLURRED = "blurred"
    FAR = "far"
    CUT = "cut"
    SAME = "same"


FLAWS: Mapping[Flaw, str] = {
    Flaw.BLURRED: "blurred beside the others: hold camera and target still",
    Flaw.FAR: "too far: go nearer, so that squares are larger in the picture",
    Flaw.CUT: "board cut off by the picture's edge: bring it in whole",
    Flaw.SAME: "same place as before: it adds little, follow the ghost board",
}
"""What is wrong, and what to do."""

LISTENING = (
    "note: everybody in this network who has the page's address sees the pictures and can end the "
    "shoot, and nothing is encrypted: use it in a network that you trust, or leave --listen out"
)
TO_FINISH = "Enter finishes with these photos; Ctrl-C stops for now, and no photo is lost."
OVER = "the camera gives no more pictures"


def summary(guidance: Guidance | None, photos: int, held_out_px: float | None) -> str:
    """How far the shoot is, in one line: photos, uncertainty, coverage, the held-out error."""
    said = [plural(photos, "photo")]
    if guidance is not None and guidance.advice is not None and guidance.advice.now is not None:
        covered = guidance.advice.gaps.cells.coverage
        if guidance.advice.photos_needed:
            said.append(f"about {guidance.advice.photos_needed} more to take")
        said.append(
            f"± {guidance.advice.now.p95_px:.2f} px over the field (goal {guidance.goal_px:g} px)"
        )
        said.append(f"corners cover {100 * covered:.0f} % of it")
    if held_out_px is not None:
        said.append(f"off by {held_out_px:.2f} px on photos set aside")
    return ", ".join(said)


def next_words(guidance: Guidance | None) -> str:
    """What to do next."""
    if guidance is None:
        return "Take a photo of the target."
    if guidance.advice is not None and guidance.advice.enough:
        return "Enough: finish, or go on for a smaller uncertainty."
    if guidance.words:
        return guidance.words
    return "Show the target from other sides and in other parts of the picture."


def opened(address: str) -> str:
    """Where the page is."""
    return f"Open {address} in a browser. Ctrl-C stops; no photo is lost."


def finished(verdict: Verdict, folder: Path) -> str:
    """What came of the photos."""
    word = verdict.words
    return f"{word[:1].upper()}{word[1:]}: {verdict.figures}. Written to {shown(folder)}."


def about_target(target: Target) -> list[str]:
    """What to know of a target before the first photo: what to measure, and `target check`."""
    printed, units = target.as_printed(), target.units
    return [
        *(
            f"{one.name}: {one.columns}x{one.rows} corners, squares of {one.square:g} {units}, "
            f"print of {' x '.join(f'{side:g}' for side in print_size(one))} {units}: measure it"
            for one in printed.boards
        ),
        *(text for _, text in check_target(printed).advice),
    ]
