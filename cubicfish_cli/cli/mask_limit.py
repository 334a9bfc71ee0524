"""``--mask``, and ``--mask-limit``: where the camera itself may be off by too much."""

from __future__ import annotations

import math
from pathlib import Path

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import FILE, option

mask_option = option(
    "--mask FILE", "Also write where the result may be trusted: 255, and 0 elsewhere.", FILE
)

mask_limit_option = option(
    "--mask-limit PX",
    "With --mask: 0 also where the camera's own uncertainty is above this, in pixels of the "
    "photo as calibrated.",
    FloatRange(0, min_open=True),
)


def check_mask_limit(limit: float | None, mask: Path | None) -> None:
    """Refuse a limit without a mask.

    Raises:
        click.UsageError: it has none, or is not a number.

    """
    if limit is None:
        return
    if math.isnan(limit):
        raise click.UsageError("--mask-limit must be a number of pixels above 0")
    if mask is None:
        raise click.UsageError("--mask-limit goes with --mask: name the mask's file")
