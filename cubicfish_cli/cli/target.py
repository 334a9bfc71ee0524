"""``cubicfish target``: the calibration object before any photo is taken."""

from __future__ import annotations

import click

from cubicfish_cli.cli import target_check
from cubicfish_cli.cli.options import common_options, examples


@click.group(
    "target",
    short_help="Check the calibration object before taking photos.",
    epilog=examples("cubicfish target check target.yaml --draw object.svg"),
)
@common_options
def command() -> None:
    """Look at the calibration object before any photo is taken."""


command.add_command(target_check.command)
