"""``cubicfish rig``: the commands of several cameras on one body."""

import click

from cubicfish_cli.terminal.main import LazyGroup
from cubicfish_cli.terminal.parameters import common_options, examples

COMMANDS = ("calibrate", "evaluate", "compare", "info", "report", "undistort", "map", "export")


@common_options
@click.group(
    "rig",
    cls=LazyGroup,
    of="rig",
    own={name: f"cubicfish_cli.extensions.rigs.{name}:command" for name in COMMANDS},
    short_help="Calibrate and use several cameras on one body.",
    epilog=examples(
        "cubicfish rig calibrate left/ right/ --target target.yaml",
        "cubicfish rig info",
        "cubicfish rig undistort left/1.png right/1.png all.png",
        "cubicfish rig calibrate -h",
    ),
)
def command() -> None:
    """Calibrate several cameras on one body, and work with what they see.

    A rig is a folder with rig.yaml and a folder for each camera. Commands for a single camera take
    that camera's folder: 'cubicfish undistort photo.png flat.png --model rig/left'.
    """
