"""``--mask``, and ``--mask-limit``: where the camera itself may be off by too much."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import FILE, bundle, option

if TYPE_CHECKING:
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.library.masks import TrustedWithin
    from cubicfish_cli.undistortion.frames import Crop


@dataclass(frozen=True, kw_only=True)
class MaskOptions:
    """What the user asked of a mask; None where nothing was asked."""

    mask: Path | None
    mask_limit: float | None

    def check(self) -> None:
        """Refuse a limit without a mask."""
        if self.mask_limit is not None and self.mask is None:
            raise click.UsageError("--mask-limit goes with --mask: name the mask's file")

    def trusted(
        self, loaded: CameraFile | PointCameraFile, path: Path, crop: Crop | None
    ) -> TrustedWithin | None:
        """What says where a camera may be trusted; None where no limit was asked for.

        Raises:
            CameraFileError: the camera's file does not say.

        """
        if self.mask_limit is None:
            return None
        from cubicfish_cli.library.masks import TrustedWithin

        return TrustedWithin(self.mask_limit, loaded, path, crop)


mask_options = bundle(
    "mask",
    MaskOptions,
    option(
        "--mask FILE", "Also write where the result may be trusted: 255, and 0 elsewhere.", FILE
    ),
    option(
        "--mask-limit PX",
        "With --mask: 0 also where the camera's own uncertainty is above this, in pixels of the "
        "photo as calibrated.",
        FloatRange(0, min_open=True),
    ),
)
