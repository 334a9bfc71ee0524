"""Options of a view, or of a board's plane."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import UsageError, listed
from cubicfish.views import ViewOptions
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import (
    SIZE,
    FloatRange,
    bundle,
    option,
    target_option,
    target_path,
)
from cubicfish_cli.terminal.terminal import print_message
from cubicfish_cli.undistortion.options import PlaneOptions

if TYPE_CHECKING:
    from cubicfish.views import ChosenView

_PLANE = "plane:"


def _read_numbers(text: str, between: str) -> tuple[float | str, ...]:
    """Return the numbers of a text; any other text stays, and the view refuses it by its name."""
    try:
        return tuple(map(float, re.split(between, text)))
    except ValueError:
        return (text,)


class _KindOrPlane(parameters.Choice):
    """A kind of view, or plane:BOARD."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Accept planes, and all that is among the choices."""
        is_plane = value.startswith(_PLANE) and value != _PLANE
        return str(value if is_plane else super().convert(value, param, ctx))


def _make_options(
    kind: str | None,
    size: tuple[int, int] | None,
    field: str | None,
    scale: float | None,
    fit: str | None,
    rotate: str | None,
    target: Path | None = None,
) -> ViewOptions | PlaneOptions:
    if kind is None or not kind.startswith(_PLANE):
        if target is not None:
            raise UsageError("--target goes with --view plane:BOARD: leave it out")
        across, *down = _read_numbers(field, "[xX×]") if field else (None,)
        turn = _read_numbers(rotate, ",") if rotate else ()
        limits: dict[str, Any] = {
            "hfov_deg": across,
            "vfov_deg": down[0] if len(down) == 1 else down or None,
            "fit": _read_numbers(fit, "$")[0] if fit else None,
            "rotate_deg": (*turn, *(0.0,) * (3 - len(turn))),
        }
        return ViewOptions(kind=kind, size=size, focal=scale, **limits)
    others = {"--size": size, "--hfov": field, "--fit": fit, "--rotate": rotate}
    for name, value in others.items():
        if value is not None:
            raise UsageError(f"{name} does not go with --view {kind}: choose --scale instead")
    path = target_path(target)
    if path is None:
        raise UsageError(f"--view {kind} needs the target: name it with --target target.yaml")
    board = kind.removeprefix(_PLANE)
    return PlaneOptions(board=board, target=path, pixels_per_unit=scale)


def view_bundle(
    *,
    kinds: str = listed(ViewOptions.KINDS, word="or"),
    kind_default: str = "perspective, in which straight lines are straight",
    size_default: str = "the photo's",
    field_default: str = "perspective keeps the photo's scale in its middle, up to 120 along the "
    "longer side; others take --fit outer",
    whole: bool = True,
    planes: bool = False,
) -> Any:
    """Options of a view, as a :class:`ViewOptions`.

    Args:
        kinds: the kinds of view that there are, in words.
        kind_default: the default kind, in words.
        size_default: the default size, in words.
        field_default: the default field, in words.
        whole: whether the whole photo may be shown.
        planes: whether it may also be the plane of a board with its target, then a
            :class:`PlaneOptions`.

    """
    plane_kind = f"; of photos also {_PLANE}BOARD, the metric picture of the plane of a board in "
    plane_scale = "; for a plane, pixels per mm, or per whatever unit the target is in"
    shares = "inner|outer|whole|SHARE" if whole else "inner|outer|SHARE"
    unseen = "; or the whole photo, extrapolated where the camera is not calibrated" * whole
    return bundle(
        _make_options,
        kind=option(
            "--view KIND",
            f"What the result is: {kinds}{f'{plane_kind}--target' if planes else ''}. "
            f"[default: {kind_default}]",
            (_KindOrPlane if planes else parameters.Choice)(ViewOptions.KINDS),
        ),
        size=option("--size", f"Size of the result. [default: {size_default}]", SIZE),
        field=option(
            "--hfov --fov DEG[xDEG]",
            "Field of view across the width, in degrees; a second angle is the one down the "
            f"height, and sets how high the picture is. [default: {field_default}]",
            click.STRING,
        ),
        scale=option(
            "--scale PX",
            "Pixels per radian in the middle, which is a flat picture's focal length"
            f"{plane_scale * planes}.",
            FloatRange(1e-9, 1_000_000_000),
        ),
        fit=option(
            f"--fit {shares}",
            "Field from what the camera sees: no empty pixel, nothing lost, or a share "
            f"between (0 to 1){unseen}.",
            click.STRING,
        ),
        rotate=option(
            "--rotate YAW,PITCH,ROLL",
            "Turn the view to the right, then up, then clockwise, in degrees.",
            click.STRING,
        ),
        **({"target": target_option} if planes else {}),
    )


view_options: Any = view_bundle()
"""A view from the camera's place, as a :class:`ViewOptions`."""

view_or_plane_options: Any = view_bundle(planes=True)
"""The same, or the plane of a board with its target, as a :class:`PlaneOptions`."""


def report_unseen(view: ChosenView) -> None:
    """Tell the user if the camera's field ends before the view's does, and what is lost."""
    from cubicfish_cli.undistortion.remarks import view_remarks

    for remark in view_remarks(view):
        print_message(remark)
