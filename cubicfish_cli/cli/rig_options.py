"""Options of ``cubicfish undistort`` that say how several cameras' photos become one picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import Parsed, bundle, option, rig_option


def _ground(text: str) -> tuple[float, float, float]:
    """Height, and pitch and roll in degrees; what is left out is 0."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not 1 <= len(values) <= 3 or not 0 < values[0] < 1e9:
        raise ValueError(f"{text!r} is not HEIGHT,PITCH,ROLL, such as 1200,-10,0")
    height, pitch, roll = (*values, 0.0, 0.0)[:3]
    if not (-90 <= pitch <= 90 and -180 <= roll <= 180):
        raise ValueError(f"{text!r}: PITCH is from -90 to 90, and ROLL from -180 to 180 degrees")
    return height, pitch, roll


@dataclass(frozen=True, kw_only=True)
class RigOptions:
    """What the user asked of a rig; None where nothing was asked."""

    rig: Path | None
    ground: tuple[float, float, float] | None
    shot: str | None
    distance: float | None

    @property
    def is_asked(self) -> bool:
        """Whether a rig is meant at all, and options that need one without it are refused.

        Raises:
            click.UsageError: there is such an option and no ``--rig``.

        """
        given = {"--ground": self.ground, "--shot": self.shot, "--distance": self.distance}
        names = [name for name, value in given.items() if value is not None]
        if self.rig is None and names:
            raise click.UsageError(f"{names[0]} goes with --rig: name the rig.yaml")
        return self.rig is not None


rig_options = bundle(
    "rig",
    RigOptions,
    rig_option,
    option(
        "--ground HEIGHT[,PITCH[,ROLL]]",
        "Of a rig: the ground from above. It is HEIGHT below the first camera, which looks "
        "PITCH degrees up (below 0: down) and is rolled ROLL degrees clockwise. With --plane it is "
        "where that board lies.",
        Parsed("HEIGHT[,PITCH[,ROLL]]", _ground),
    ),
    option(
        "--shot NAME",
        "Of a rig, with --plane: the shot of rig.yaml that says where the board lies. "
        "[default: the shot itself]",
    ),
    option(
        "--distance UNITS",
        "Of a rig: how far away things are that the cameras' pictures join at. [default: far away]",
        FloatRange(0, min_open=True),
    ),
)
