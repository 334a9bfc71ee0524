"""``cubicfish target``: the calibration object, printed and checked before any photo is taken."""

from __future__ import annotations

import click

from cubicfish_cli.cli import target_check, target_print
from cubicfish_cli.cli.options import common_options, examples


@click.group(
    "target",
    short_help="Print or check the calibration target, before any photo.",
    epilog=examples(
        "cubicfish target print --object corner --paper A4 -o my-target/",
        "cubicfish target check target.yaml --draw object.svg",
    ),
)
@common_options
def command() -> None:
    """Print the calibration target, and look at it before any photo is taken."""


command.add_command(target_print.command)
command.add_command(target_check.command)
