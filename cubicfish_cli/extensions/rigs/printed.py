"""What is printed of rigs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cubicfish_cli.terminal.figures import print_errors, print_verdict, px
from cubicfish_cli.terminal.terminal import print_table, result
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Rig
    from cubicfish.rigs import RigEvaluation


_WORST = 10


def print_rig(rig: Rig) -> None:
    """Print where the cameras stand, how well it fits, and what the rig is worth."""
    fit, out = rig.fit, rig.fit.held_out_rms_px
    result(
        f"{plural(len(rig.cameras), 'camera')}, {plural(fit.shots, 'shot')}, "
        f"{plural(fit.corners, 'corner')} used\n"
    )
    meaning = "" if math.isnan(out) else "shots not used in the fit"
    print_errors(fit, [("held-out RMS", out, meaning)])
    result()
    print_table(
        ("camera", f"x {rig.units or ''}".strip(), "y", "z", "± shift", "turned °", "± turn °",
         "photos", "RMS px", "alone px"),
        [
            (
                one.name,
                *(f"{value:.2f}" for value in one.position),
                f"{one.shift_sigma:.3f}",
                f"{one.turned_deg:.3f}",
                f"{one.turn_sigma_deg:.4f}",
                str(one.in_rig.images),
                px(one.in_rig.rms_px),
                px(one.in_rig.alone_rms_px),
            )
            for one in rig.cameras
        ],
    )  # fmt: skip
    _print_pairs(rig)
    worst = sorted(fit.per_shot, key=lambda one: -one.rms_px)[:_WORST]
    result()
    print_table(
        ("shots, worst first", "corners", "RMS px", "cameras"),
        [(one.shot, str(one.corners), px(one.rms_px), ", ".join(one.cameras)) for one in worst],
    )
    result()
    print_verdict(rig.verdict)


def _print_pairs(rig: Rig | RigEvaluation) -> None:
    """Print what connects every two cameras."""
    result()
    print_table(
        ("cameras", "shots in common", "RMS px"),
        [(" + ".join(one.cameras), str(one.shots), px(one.rms_px)) for one in rig.pairs],
    )


def print_evaluation(evaluation: RigEvaluation) -> None:
    """Print how well a rig explains other shots."""
    shots, corners = plural(len(evaluation.per_shot), "shot"), plural(evaluation.corners, "corner")
    result(f"{shots}, {corners}\n")
    meaning = "the same corners with each photo's own pose: what is more is the rig's"
    print_errors(evaluation, [("each alone", evaluation.alone_rms_px, meaning)])
    result()
    print_table(
        ("camera", "photos", "RMS px", "alone px"),
        [
            (one.name, str(one.images), px(one.rms_px), px(one.alone_rms_px))
            for one in evaluation.cameras
        ],
    )
    _print_pairs(evaluation)
