"""The page about a rig, and its figures: where cameras stand, what they see, how shots fit."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cubicfish import Rig, Verdict
from cubicfish.judge import Severity
from cubicfish_cli.render.pages.figures import (
    BOARD_COLOURS,
    Drawn,
    Key,
    draw_cameras,
    finished,
    upright,
)
from cubicfish_cli.render.pages.plot import INK, MUTED, Space
from cubicfish_cli.render.pages.template import template
from cubicfish_cli.words.sentences import render

_MOST_SHOTS = 20
COLOURS = (*BOARD_COLOURS, "#56b4e9", MUTED, INK)
# Size of a drawn camera, as a share of the rig's size.
_CAMERA = 0.14


def rig_html(rig: Rig) -> str:
    """One self-contained HTML page about a rig.

    The same rig gives the same page, to the byte.
    """
    colours = [COLOURS[number % len(COLOURS)] for number in range(len(rig.cameras))]
    figure = _draw_places(rig, colours)
    known = [one for one in rig.fit.per_shot if not np.isnan(one.rms_px)]
    return template(Path(__file__).with_name("page.html")).render(
        verdict=rig.verdict,
        words=Verdict.WORDS,
        render=render,
        notes=[render(one).line for one in rig.fit.findings if one.severity is Severity.NOTE],
        rig=rig,
        colours=colours,
        figures={figure.name: figure},
        worst=sorted(known, key=lambda one: -one.rms_px)[:_MOST_SHOTS],
        made=rig.origin,
        day=rig.origin.day,
    )


def _draw_places(rig: Rig, colours: Sequence[str]) -> Drawn:
    """Where the cameras stand and look."""
    at = np.stack([one.position for one in rig.cameras])
    rotation = np.stack([one.rotation for one in rig.cameras])
    # Up is where most photos have their top; ahead is where the first camera looks.
    turn = upright(rotation[0, 2], -rotation[:, 1].mean(axis=0))
    at, rotation = at @ turn.T, rotation @ turn.T
    size = _CAMERA * (float(np.ptp(at, axis=0).max()) or 1.0)
    space = Space(np.concatenate([at, at + size * rotation[:, 2]]), 30, -60)
    draw_cameras(space, at, rotation, size, colours)
    for number, place in enumerate(at, start=1):
        space.text(place, str(number))
    named = enumerate(zip(colours, rig.cameras, strict=True), start=1)
    return finished(
        space,
        name="rig-places",
        title="The rig",
        label=f"{len(at)} cameras in space",
        caption=f"Lengths are in {rig.units or 'the units of the target'}; open sides look ahead.",
        keys=tuple(
            Key(kind="area", colour=colour, text=f"{number} {one.name}")
            for number, (colour, one) in named
        ),
    )
