"""Options that say what an undistorted picture shows."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.options import Decorated, SizeType

if TYPE_CHECKING:
    from cubicfish_cli.model.cubic import CubicCamera
    from cubicfish_cli.undistortion.views import CentralView

_ANGLE = click.FloatRange(-360, 360)


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """What the user asked of the view; None and zero where nothing was asked."""

    size: tuple[int, int] | None
    hfov_deg: float | None
    yaw_deg: float
    pitch_deg: float
    roll_deg: float

    def view_of(self, camera: CubicCamera) -> CentralView:
        """The view of this camera.

        Without a field of its own it keeps the default view's field at any size.

        Raises:
            ViewError: the view is not one that can be rendered.

        """
        from cubicfish_cli.undistortion.views import (
            PerspectiveView,
            default_view,
            rotation_from_angles,
        )

        default = default_view(camera)
        rotation = rotation_from_angles(
            yaw_deg=self.yaw_deg, pitch_deg=self.pitch_deg, roll_deg=self.roll_deg
        )
        size = self.size or default.size
        if self.hfov_deg is not None:
            return PerspectiveView.with_field(self.hfov_deg, size, rotation)
        return replace(
            default,
            size=size,
            focal=default.focal * size[0] / default.size[0],
            rotation=rotation,
        )


def view_options(function: Decorated) -> Decorated:
    """The options; the command gets them as one argument, ``view``."""

    @functools.wraps(function)
    def with_view(*args: Any, **options: Any) -> Any:
        names = ("size", "hfov_deg", "yaw_deg", "pitch_deg", "roll_deg")
        view = ViewOptions(**{name: options.pop(name) for name in names})
        return function(*args, view=view, **options)

    decorators: tuple[Callable[[Any], Any], ...] = (
        click.option(
            "--roll",
            "roll_deg",
            type=_ANGLE,
            default=0.0,
            metavar="DEG",
            help="Turn the view clockwise about its axis.",
        ),
        click.option(
            "--pitch",
            "pitch_deg",
            type=_ANGLE,
            default=0.0,
            metavar="DEG",
            help="Look up (negative: down).",
        ),
        click.option(
            "--yaw",
            "yaw_deg",
            type=_ANGLE,
            default=0.0,
            metavar="DEG",
            help="Look to the right (negative: left).",
        ),
        click.option(
            "--fov",
            "hfov_deg",
            type=click.FloatRange(0, 180, min_open=True, max_open=True),
            metavar="DEG",
            help="Field of view across the width. [default: the photo's scale in its middle is "
            "kept, up to 120 along the longer side]",
        ),
        click.option(
            "--size",
            type=SizeType(),
            help="Size of the result. [default: the photo's]",
        ),
    )
    decorated: Any = with_view
    for decorator in decorators:
        decorated = decorator(decorated)
    result: Decorated = decorated
    return result


def describe(view: CentralView) -> str:
    """A view in a few words."""
    width, height = view.size
    return f"{width}x{height} pixels, {view.hfov_deg:.1f}° across, focal length {view.focal:.2f} px"
