"""Options that ask for the plane of a board."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import FILE, bundle, option
from cubicfish_cli.cli.target_choice import target_path
from cubicfish_cli.cli.view_options import ViewOptions

if TYPE_CHECKING:
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.library.planes import PlanesOfPhotos
    from cubicfish_cli.target import Target
    from cubicfish_cli.undistortion.frames import Crop


@dataclass(frozen=True, kw_only=True)
class PlaneOptions:
    """What the user asked of a board's plane; ``board`` is None where nothing was asked."""

    board: str | None
    target: Path | None
    pixels_a_unit: float | None
    margin: float | None

    def check(self, view: ViewOptions) -> None:
        """Refuse what does not go together."""
        if self.board is None:
            if self.pixels_a_unit is not None or self.margin is not None:
                raise click.UsageError("--pixels-per-unit and --margin go with --plane")
            return
        if target_path(self.target) is None:
            raise click.UsageError("--plane needs the target: name it with --target target.yaml")
        if view.is_asked:
            raise click.UsageError(
                "--plane sets size and direction by the board: leave out the view's options, "
                "or choose --pixels-per-unit and --margin"
            )

    def loaded(self) -> Target:
        """The target.

        Raises:
            click.UsageError: none was named, and none is there.
            TargetError: its file cannot be used.

        """
        from cubicfish_cli.target import load_target

        path = target_path(self.target)
        if path is None:
            raise click.UsageError("--plane needs the target: name it with --target target.yaml")
        return load_target(path)

    def views(self, loaded: CameraFile | PointCameraFile, crop: Crop | None) -> PlanesOfPhotos:
        """The board's plane in each photo.

        Raises:
            TargetError: the target is not usable.
            click.UsageError: it has no such board, or the board has no plane.

        """
        from cubicfish_cli.errors import ViewError
        from cubicfish_cli.library.planes import PlanesOfPhotos

        target = self.loaded()
        try:
            return PlanesOfPhotos(
                loaded,
                crop,
                target,
                str(self.board),
                pixels_per_unit=self.pixels_a_unit,
                margin=self.margin,
            )
        except ViewError as problem:
            raise click.UsageError(str(problem)) from None


plane_options = bundle(
    "plane",
    PlaneOptions,
    option(
        "--plane BOARD",
        "The metric picture of a board's plane instead of a view; needs --target.",
        to="board",
    ),
    option(
        "-t --target FILE",
        "The calibration target: a target.yaml, or one of Kalibr's target files. Where "
        "one is needed, ./target.yaml stands for it; for --plane.",
        FILE,
    ),
    option(
        "--pixels-per-unit N",
        "Scale of a plane: pixels per mm, or whatever the target's units are. [default: "
        "the largest that the photo has there]",
        FloatRange(1e-9, 1_000_000_000),
        to="pixels_a_unit",
    ),
    option(
        "--margin UNITS",
        "Of a plane: how far it goes on beyond the outer corners. [default: a square]",
        FloatRange(0, 1_000_000),
    ),
)
