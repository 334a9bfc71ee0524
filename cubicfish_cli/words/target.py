"""What to know about a target before any photo is taken of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from cubicfish import listed
from cubicfish.target import MILLIMETRES
from cubicfish_cli.words.phrases import pick

if TYPE_CHECKING:
    from cubicfish import Target
    from cubicfish.diagnosis import ObjectFacts

# More examples than this are not read.
_MOST = 4
# Sides of squares that people photograph.
_FINEST_MM, _LARGEST_MM = 0.2, 2000.0


def advise(target: Target, facts: ObjectFacts) -> list[tuple[str, str]]:
    """Return (topic, text) of each piece of advice, in order."""
    crossing = (
        f"The prints of {one} and {other} overlap: check origin and axes."
        for one, other in facts.crossing[:_MOST]
    )
    return [
        ("Photos", how_many_photos(flat=facts.flat)),
        *(("Names", text) for text in _advise_on_names(target, facts)),
        *(("Places", text) for text in crossing),
        *(("Sizes", text) for text in _advise_on_sizes(target)),
    ]


def how_many_photos(*, flat: bool) -> str:
    """Return how many photos such a target needs."""
    if flat:
        return (
            "The target is flat, and one photo of a flat board cannot determine a lens: take ten, "
            "tilted to all sides and filling the picture to the rim."
        )
    return (
        "One photo can be enough, if it shows boards at an angle and fills the picture to the rim. "
        "Three or more also give the held-out error."
    )


def _advise_on_names(target: Target, facts: ObjectFacts) -> Iterator[str]:
    plain, alone = facts.plain, len(facts.plain) == 1
    if facts.named_by == "table":
        yield (
            "Lists of points are not looked for in photos: calibrate from a corners.csv that says "
            "where they are."
        )
    elif facts.named_by == "markers":
        yield "The markers' ids name the corners: nothing can be confused."
        if plain:
            yield (
                f"{', '.join(plain)}, without markers, {pick(plain, 'is', 'are')} found where a "
                "board with markers is in the same photo."
            )
    else:
        yield from _advise_on_turns(target, facts)
        if not alone:
            yield _advise_on_look_alikes(facts.look_alikes)


def _advise_on_turns(target: Target, facts: ObjectFacts) -> Iterator[str]:
    yield from _describe_turns(facts)
    alone = len(facts.plain) == 1
    oblong = any(board.has_squares and board.columns != board.rows for board in target.boards)
    if facts.symmetries:
        upright = "columns to the right, rows down"
        if alone and oblong:
            upright = "its longer side runs to the right or down"
        yield (
            "Its corners may be named either way; the lens does not depend on it. The more upright "
            f"way in the photo is used: {upright}."
        )
    elif alone:
        yield (
            f"The colours of its squares tell which way round {facts.plain[0]} is: nothing can be "
            "confused when it is seen whole."
        )


def _advise_on_look_alikes(look_alikes: Sequence[Sequence[str]]) -> str:
    alike = [f"{listed(own, 'boards')} look like each other" for own in look_alikes if len(own) > 1]
    if turned := [own[0] for own in look_alikes if len(own) == 1]:
        alike.append(f"{listed(turned, 'boards')} {pick(turned, 'looks', 'look')} the same turned")
    if not alike:
        return "In photos each board, seen whole, is told from the others by its size and colours."
    return (
        f"Seen alone, {'; '.join(alike)}. A photo that leaves more than one way to name "
        "corners is left out, and nothing is guessed: take photos of several boards at once."
    )


def _advise_on_sizes(target: Target) -> Iterator[str]:
    """Doubt lengths that look like those of another unit."""
    factor = MILLIMETRES.get(target.units.lower(), 0.0)
    for board in target.boards:
        side = factor * board.square
        if side and not _FINEST_MM <= side <= _LARGEST_MM:
            size = pick(side < _FINEST_MM, "small", "large")
            yield (
                f"A square of {board.name}, {board.square:g} {target.units}, is very {size}: is "
                "it given in the unit that units names?"
            )


def _describe_turns(facts: ObjectFacts) -> Iterator[str]:
    for turn in facts.symmetries[:_MOST]:
        if len(facts.plain) == 1:
            about, same = f"the middle of {turn.boards[0]}", "it"
        else:
            axis = ", ".join(f"{round(float(value), 2) + 0.0:g}" for value in turn.axis)
            moved = ", ".join(f"{a} → {b}" for a, b in zip(turn.boards, turn.onto, strict=True))
            about, same = f"the axis ({axis}) ({moved})", "the target"
        yield f"Turned by {turn.angle_deg:.0f}° about {about} {same} looks the same."
    more = len(facts.symmetries) - _MOST
    if more > 0:
        yield f"{more} more turns look the same, too."
