"""The options of a view: its kind, its size, its field, and where it looks.

The module imports nothing heavy, so that a program can check options before it loads more. What it
says names them as arguments, in whose place a program may put its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

from cubicfish.errors import UsageError
from cubicfish.wording import did_you_mean, listed, quoted

if TYPE_CHECKING:
    from cubicfish.views.fields import Fit

Kind = Literal[
    "perspective",
    "cylindrical",
    "equirectangular",
    "epipolar-cylindrical",
    "epipolar-equirectangular",
    "stereographic",
    "equidistant",
]
KINDS = (*get_args(Kind), "cube")

Interpolation = Literal["nearest", "linear", "cubic", "lanczos"]
"""How pixels are interpolated, as OpenCV does it."""

INNER, OUTER = 0.0, 1.0
WHOLE = "whole"
_ENDS = {"inner": INNER, "outer": OUTER, WHOLE: WHOLE}
_FIELD = ("hfov_deg", "vfov_deg", "focal", "fit")
_FIT = "'inner', 'outer', 'whole' or a share from 0 to 1"
_NUMBERS: Mapping[str, tuple[str, int, Callable[[float], bool]]] = {
    "size": ("WIDTHxHEIGHT in whole pixels", 2, float.is_integer),
    "hfov_deg": ("a number of degrees above 0", 1, lambda number: number > 0),
    "vfov_deg": ("a number of degrees above 0", 1, lambda number: number > 0),
    "focal": ("a number of pixels per radian above 0", 1, lambda number: number > 0),
    "fit": (_FIT, 1, lambda share: INNER <= share <= OUTER),
    "rotate_deg": ("yaw,pitch,roll in degrees", 3, math.isfinite),
}
"""Name -> what it must be, the count of its numbers, and a test of each number."""
_ARGUMENTS = {
    "kind": "kind",
    "size": "size",
    "hfov_deg": "hfov_deg",
    "vfov_deg": "vfov_deg",
    "focal": "focal",
    "fit": "fit",
    "rotate_deg": "rotate_deg",
    "both_angles": "hfov_deg with vfov_deg",
    "second_angle": "vfov_deg ",
}
"""What its errors call them: the last two are a pair of angles, and the second of such a pair."""


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """The options of a view of any camera's photos, for :func:`~.choose.choose_view`.

    Attributes:
        KINDS: the kinds that there are.
        kind: one of those of :func:`build_view`, or ``cube``; by default ``perspective``, and of a
            rig ``equirectangular``.
        size: (width, height) of the picture or of each face of a cube, pixels.
        hfov_deg, vfov_deg, focal, rotate_deg: as for :func:`build_view`.
        fit: likewise, or ``whole``: all that photos show, also where the camera is not calibrated.

    Numbers of any kind are converted to Python's own, and ``fit`` to a share.

    Raises:
        UsageError: an option is not usable, is given twice, or is not one of this kind of view.

    """

    KINDS: ClassVar[tuple[str, ...]] = KINDS

    kind: str | None = None
    size: tuple[int, int] | None = None
    hfov_deg: float | None = None
    vfov_deg: float | None = None
    focal: float | None = None
    fit: Fit | None = None
    rotate_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        kind = self.kind or KINDS[0]
        if kind not in KINDS:
            raise UsageError(
                f"unknown kind of view {quoted(kind)}: {did_you_mean(str(kind), KINDS)}"
            )
        for name in _NUMBERS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, self._convert(name))
        limits = [name for name in self._given if name != "vfov_deg" or self.hfov_deg is None]
        if kind == "cube":
            _refuse_for_cube(limits, self.size)
        if len(limits) > 1:
            both = " and ".join(f"{{{name}}}" for name in limits)
            raise _wrong(f"{both} say the same thing twice", "leave one out")
        if {"hfov_deg", "vfov_deg"} <= {*self._given} and self.size is not None:
            raise _wrong(
                "{both_angles} sets how high the picture is",
                "leave out {size}, or the second angle",
            )
        for axis, angle in enumerate((self.hfov_deg, self.vfov_deg)):
            if angle is not None:
                _refuse_too_wide(kind, axis, angle)

    def _convert(self, name: str) -> Any:
        """Convert one number, or a tuple of several, of any kind to Python's own."""
        what, count, fits = _NUMBERS[name]
        given = getattr(self, name)
        if name == "fit" and isinstance(given, str) and given in _ENDS:
            return _ENDS[given]
        try:
            parts = list(given) if count > 1 else [given]
            values = tuple(float(part) for part in parts if not isinstance(part, str))
        except (TypeError, ValueError, OverflowError):
            values = ()
        if len(values) != count or not all(math.isfinite(one) and fits(one) for one in values):
            raise _wrong(f"{{{name}}} must be {what}, not {quoted(given)}")
        if name == "size":
            return tuple(map(round, values))
        return values if count > 1 else values[0]

    @property
    def _given(self) -> list[str]:
        """Names of what sets the field."""
        return [name for name in _FIELD if getattr(self, name) is not None]

    @property
    def gives_field(self) -> bool:
        """Whether the field was given itself, and not only how it fits."""
        return any(name != "fit" for name in self._given)

    @property
    def leaves_field_open(self) -> bool:
        """Whether neither size nor field was given."""
        return self.size is None and not self._given

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the pictures that a photo becomes; a single picture has an empty name."""
        from cubicfish.views.view import FACES

        return tuple(FACES) if self.kind == "cube" else ("",)


def _wrong(what: str, do: str = "") -> UsageError:
    return UsageError(what, do=do, arguments=_ARGUMENTS)


def _refuse_for_cube(limits: Sequence[str], size: tuple[int, int] | None) -> None:
    """Raise :class:`UsageError` where the faces of a cube cannot be as they are asked for."""
    if limits:
        raise _wrong(
            "the faces of a cube have 90° each", f"leave out {{{limits[0]}}}, or choose {{size}}"
        )
    if size and size[0] != size[1]:
        raise _wrong("a cube's faces are square", "give {size} as NxN")


def _refuse_too_wide(kind: str, axis: int, angle_deg: float) -> None:
    """Raise :class:`UsageError` where a kind of view cannot show a field across or down."""
    from cubicfish.views.view import PROJECTIONS

    def shows(name: str) -> bool:
        limit, closed = PROJECTIONS[name].widest[axis]
        return angle_deg < limit or (closed and angle_deg == limit)

    if shows(kind):
        return
    limit, closed = PROJECTIONS[kind].widest[axis]
    most = f"{limit:g}° at most" if closed else f"less than {limit:g}°"
    flat = "about 120 or less, or " * (kind == "perspective")
    view = f"{'an' if kind.startswith('e') else 'a'} {kind} view"
    given, way = (("{hfov_deg} ", "across"), ("{second_angle}", "down"))[axis]
    others = [
        name
        for name in PROJECTIONS
        if shows(name) and kind.startswith("epi") >= name.startswith("epi")
    ]
    choose = f"{flat}{{kind}} {listed(others, word='or')}" if others else "less"
    raise _wrong(f"{given}{angle_deg:g} is too wide: {view} shows {most} {way}", f"choose {choose}")
