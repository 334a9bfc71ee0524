"""Source text of a camera in another language: the templates' figures and formulas."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import cache
from importlib.resources import files
from string import Template

import numpy as np
import numpy.typing as npt

from cubicfish import Calibration, CameraFile, CubicCamera, FloatArray, UsageError, quoted, shown
from cubicfish.models import cone_rays
from cubicfish.models.lift import lift
from cubicfish_cli import __version__

# As CubicCamera has them: a ray this close beyond the edge is rounding; one whose sine is smaller
# than this is along the axis.
_EDGE_SLACK, _ON_AXIS = 1e-9, 1e-6
# How far beyond the field a search may go, radians: it may come at the edge from there.
_BEYOND = 0.01
_TRIES = 12
_TERMS = 8  # of the polynomials that begin, and of the pupil's where there is no arc tangent
_RAYS = 4000
_NAME = re.compile(r"(?!gl_)[A-Za-z](?:_?[A-Za-z0-9]){0,59}")
# (3, 20): the powers of x, y and z in each monomial.
_POWERS = np.log2(lift(np.exp2(np.eye(3)))).round().astype(int)


def source_text(known: Calibration | CameraFile, to: str, name: str | None) -> str:
    """Write a camera in a language, under a name that its functions begin with.

    Raises:
        UsageError: the name is no identifier.

    """
    name = "camera" if name is None else name
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"--name {quoted(name)}: functions begin with it, so it must be letters and digits "
            "that begin with a letter, with single underscores between them, at most 60"
        )
    comment = "#" if to == "python" else "//"
    header = "\n".join(f"{comment} {line}" for line in _header(known))
    values = _float_values if to in ("glsl", "osl") else _double_values
    filled = {"header": header, **values(known.camera, name, to)}
    if to == "js":
        shader = {"header": "", **_float_values(known.camera, name, "glsl")}
        filled["glsl"] = _template("glsl").substitute(shader).lstrip()
    return _template(to).substitute(filled)


@cache
def _template(to: str) -> Template:
    folder = files("cubicfish_cli.extensions.native") / "templates"
    return Template((folder / f"{to}.txt").read_text(encoding="utf-8"))


def _header(known: Calibration | CameraFile) -> list[str]:
    """Say what camera it is: lines for people, in ASCII, since not every compiler takes more."""
    camera, error = known.camera, known.fit.held_out_rms_px
    width, height = camera.image_size
    when = f", calibrated {known.made_by['date']}" if known.made_by.get("date") else ""
    held_out = f"{error:.4f} px RMS" if math.isfinite(error) else "not known"
    title = f"{known.title}: a" if known.title else "A"
    lines = [
        f"SPDX-License-Identifier: MIT; written by cubicfish {__version__}.",
        f"{title} cubic camera of {width}x{height} pixels{when}.",
        f"Field: {camera.max_angle_deg:.3f} degrees from the axis. Held-out error: {held_out}.",
        "Pixel (0, 0) is the middle of the first one. The frame is x right, y down, z forward.",
    ]
    return [shown(line).encode("ascii", "backslashreplace").decode() for line in lines]


def _double_values(camera: CubicCamera, name: str, to: str) -> dict[str, str]:
    opening, closing = "{}" if to == "c" else "[]"
    rows = [f"  {opening}{', '.join(map(repr, row))}{closing}" for row in camera.P.tolist()]
    values = _values(camera, name, "c", repr)
    return {**values, "P": ",\n".join(rows), "monomials": ", ".join(map(_product, _POWERS.T))}


def _float_values(camera: CubicCamera, name: str, to: str) -> dict[str, str]:
    """Float numbers, of whose few digits as few as possible may be lost in differences.

    So pixels count from the axis's, 1 - z from the middle of the field's stands in the place of z,
    and of all coefficients that give the same pixels the smallest are taken, each by what its
    monomial comes to in the field.
    """
    rays = cone_rays(math.radians(camera.max_angle_deg), _RAYS)
    depth = float(1 - rays[:, 2].min()) / 2
    P = np.array(camera.P)
    P[:2] -= camera.project([0.0, 0.0, 1.0])[:, None] * P[2]
    near = np.column_stack([rays[:, :2], 1 - rays[:, 2] - depth])
    scale = np.abs(near).max(axis=0)
    columns = np.linalg.lstsq(lift(near / scale), lift(rays) @ P.T, rcond=None)[0]
    columns /= np.abs(columns[:, 2]).max() * lift(scale)[:, None]
    kind, matrix = ("vec3", f"{name}_P") if to == "glsl" else ("vector", "P")
    write = "{:.8e}".format
    rows = [f"  {kind}({', '.join(map(write, column))})" for column in columns.tolist()]
    values = _values(camera, name, matrix, write)
    return {**values, "P": ",\n".join(rows), "depth": write(depth)}


def _values(
    camera: CubicCamera, name: str, coefficient: str, write: Callable[[float], str]
) -> dict[str, str]:
    """Everything but P, as text, by the names that templates have for it."""
    limit = math.radians(camera.max_angle_deg)
    reach = math.tan(min(limit + _BEYOND, math.radians(179.9)) / 2)
    plane, start = _start(camera)
    middle = camera.project([0.0, 0.0, 1.0]).tolist()
    width, height = camera.image_size
    numbers = {
        "max_angle": limit,
        "travel": camera.pupil_travel,
        "on_axis": _ON_AXIS,
        "rim_z": math.cos(limit + _EDGE_SLACK),
        "rim_s": reach**2,
        **dict(zip(("centre_x", "centre_y"), middle, strict=True)),
        **dict(zip(("plane_xx", "plane_xy", "plane_yx", "plane_yy"), plane, strict=True)),
    }
    units = camera.units or ""
    return {
        "name": name,
        "width": str(width),
        "height": str(height),
        "units": units if re.fullmatch("[A-Za-z ]*", units) else "",
        "tries": str(_TRIES),
        **{key: write(float(value)) for key, value in numbers.items()},
        "start": _horner("s", [write(one) for one in start]),
        "pupil": _horner("t", [write(one) for one in _pupil(camera)]),
        "value": _cubic(coefficient),
        **{f"by_{axis}": _cubic(coefficient, by=k) for k, axis in enumerate("xyz")},
    }


def _cubic(coefficient: str, by: int | None = None) -> str:
    """The sum of the coefficients times the monomials, or its slope by a coordinate."""
    terms = []
    for k, powers in enumerate(_POWERS.T):
        factor = 1 if by is None else powers[by]
        if factor:
            left = powers - (np.arange(3) == by)
            monomial = f" * ({_product(left)})" if left.any() else ""
            terms.append(f"{f'{factor}.0 * ' if factor > 1 else ''}{coefficient}[{k}]{monomial}")
    return " + ".join(terms)


def _product(powers: npt.NDArray[np.int_]) -> str:
    """A monomial; the largest power comes first, as in the lift, so that it rounds the same."""
    order = sorted(range(3), key=lambda axis: -powers[axis])
    return (
        " * ".join("xyz"[axis] for axis in order for _ in range(powers[axis])) or "np.ones_like(x)"
    )


def _horner(variable: str, coefficients: Sequence[str]) -> str:
    first, *more = coefficients
    return f"{first} + {variable} * ({_horner(variable, more)})" if more else first


def _start(camera: CubicCamera) -> tuple[list[float], list[float]]:
    """How the search for a pixel's ray begins in the plane (x, y) / (1 + z).

    Returns:
        The matrix from pixels, less the axis's, to that plane near the axis, row by row; and the
        polynomial in the square of that length by which it goes on from there.

    """
    middle, slope = camera.project_jacobian([0.0, 0.0, 1.0])
    matrix = np.linalg.inv(slope[:, :2]) / 2
    rays = cone_rays(math.radians(camera.max_angle_deg), _RAYS)
    away = (camera.project(rays) - middle) @ matrix.T
    square = np.sum(away**2, axis=1)
    largest = float(square.max())
    powers = (square / largest)[:, None] ** np.arange(_TERMS)
    rows = (away[:, :, None] * powers[:, None, :]).reshape(-1, _TERMS)
    wanted = (rays[:, :2] / (1 + rays[:, 2:])).ravel()
    found = np.linalg.lstsq(rows, wanted, rcond=None)[0] / largest ** np.arange(_TERMS)
    return matrix.ravel().tolist(), found.tolist()


def _pupil(camera: CubicCamera) -> list[float]:
    """The pupil's place as a polynomial in 1 - z of the ray."""
    if not camera.pupil_travel:
        return [0.0]
    rays: FloatArray = cone_rays(math.radians(camera.max_angle_deg), _RAYS)
    depth = 1 - rays[:, 2]
    largest, power = float(depth.max()), np.arange(_TERMS + 1)
    rows = (depth / largest)[:, None] ** power
    found = np.linalg.lstsq(rows, camera.pupil_shift(rays), rcond=None)[0] / largest**power
    return found.tolist()
