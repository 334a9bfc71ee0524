"""The page about a rig, and its figures: where cameras stand, what they see, how shots fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from cubicfish_cli.assess.records import recorded_mappings, recorded_number
from cubicfish_cli.assess.verdict import WORDS, rig_verdict
from cubicfish_cli.formats.rig_yaml import RigFile, RigFileCamera
from cubicfish_cli.lenses.sphere import all_around
from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.report.figures import BOARD_COLOURS, Drawn, Key, finished, key
from cubicfish_cli.report.page import day_of, made_of, template
from cubicfish_cli.report.scene import at_one_scale, frusta, scale_bar
from cubicfish_cli.report.svg import (
    INK,
    MUTED,
    RED,
    SKY,
    STYLE,
    WIDTH,
    Box,
    add_axes,
    areas,
    dots,
    new_figure,
    rectangles,
    strokes,
)
from cubicfish_cli.types import BoolArray, FloatArray
from cubicfish_cli.words.codes import Severity
from cubicfish_cli.words.finding import of_record

_MOST_SHOTS = 20


def rig_html(rig: RigFile, record: Mapping[str, Any]) -> str:
    """One self-contained HTML page about a rig.

    The same rig gives the same page, to the byte.

    Args:
        rig: the rig and its cameras.
        record: the plain data of its file.

    """
    seen = rig.cameras
    fit = record["fit"]
    findings = recorded_mappings(fit.get("findings"))
    outlying = [str(name) for one in findings for name in one.get("shots") or []]
    notes = [one for one in map(of_record, findings) if one is not None]
    shots = recorded_mappings(fit.get("per_shot"))
    return template("rig.html").render(
        verdict=rig_verdict(record),
        words=WORDS,
        notes=[one.line for one in notes if one.severity is Severity.NOTE],
        units=rig.units,
        cameras=[
            _camera(number, one, own)
            for number, (one, own) in enumerate(
                zip(recorded_mappings(record["cameras"]), rig.cameras, strict=True)
            )
        ],
        pairs=_pairs(recorded_mappings(record["pairs"]), seen),
        figures=rig_figures(seen, shots, rig.units or "", outlying),
        worst=_worst(shots),
        shots=len(shots),
        corners=recorded_number(fit.get("corners")) or 0,
        made=made_of(rig.made_by),
        day=day_of(rig.made_by),
    )


def _half_field_deg(camera: RigFileCamera) -> float:
    covered = recorded_number(camera.file.fit.get("covered_deg"))
    return covered if covered and 0 < covered < 180 else camera.file.camera.max_angle_deg


def _sees(camera: RigFileCamera, directions: FloatArray) -> BoolArray:
    """Whether far away things are in its field, by their directions (..., 3) in the rig."""
    cosine = directions @ camera.rotation[2]
    return np.asarray(cosine >= np.cos(np.deg2rad(_half_field_deg(camera))))


def _camera(number: int, record: Mapping[str, Any], camera: RigFileCamera) -> dict[str, Any]:
    fit = record["fit"]
    known = camera.covariance is not None and number > 0
    x, y, z = record["position"]
    cosine = (np.trace(camera.rotation) - 1) / 2
    return {
        "name": camera.name,
        "colour": key("area", colour_of(number), "").colour,
        "x": f"{x:.2f}",
        "y": f"{y:.2f}",
        "z": f"{z:.2f}",
        "shift_sigma": f"{record['shift_sigma']:.3f}" if known else "–",
        "turned": f"{np.rad2deg(np.arccos(np.clip(cosine, -1, 1))):.3f}",
        "turn_sigma": f"{record['turn_sigma_deg']:.4f}" if known else "–",
        "field": f"{2 * _half_field_deg(camera):.0f}",
        "photos": f"{recorded_number(fit.get('images')) or 0:.0f}",
        "rms": recorded_number(fit.get("rms_px")),
        "alone": recorded_number(fit.get("alone_rms_px")),
    }


def _pairs(
    records: Sequence[Mapping[str, Any]], cameras: Sequence[RigFileCamera]
) -> list[dict[str, Any]]:
    share = overlap_shares(cameras)
    index = {one.name: number for number, one in enumerate(cameras)}
    found = []
    for record in records:
        names = [str(name) for name in record.get("cameras") or []]
        if len(names) != 2 or not set(names) <= set(index):
            continue
        a, b = (index[name] for name in names)
        found.append(
            {
                "names": " + ".join(names),
                "shots": f"{recorded_number(record.get('shots')) or 0:.0f}",
                "rms": recorded_number(record.get("rms_px")),
                "overlap": f"{100 * share[a, b] / max(share[a, a], 1e-9):.0f}",
            }
        )
    return found


def _worst(shots: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    known = [(rms, one) for one in shots if (rms := recorded_number(one.get("rms_px"))) is not None]
    known.sort(key=lambda pair: -pair[0])
    return [
        {
            "name": str(one.get("shot")),
            "cameras": str(len(one.get("cameras") or [])),
            "corners": recorded_number(one.get("corners")) or 0,
            "rms": rms,
        }
        for rms, one in known[:_MOST_SHOTS]
    ]


COLOURS = (*BOARD_COLOURS, SKY, MUTED, INK)
_HEIGHT, _FOOT = 250.0, 24.0
# Size of a drawn camera and length of its field, as shares of the rig's size.
_CAMERA, _REACH = 0.14, 0.8
# A field is drawn by directions in steps of so many degrees, and its map in cells of so many.
_STEP_DEG, _CELL_DEG = 2.0, 4.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Axes:
    """Which way is right, up and back for who looks at the rig."""

    right: FloatArray
    up: FloatArray
    ahead: FloatArray


def rig_figures(
    cameras: Sequence[RigFileCamera], shots: object, units: str, outlying: Sequence[str] = ()
) -> dict[str, Drawn]:
    """Every figure, by its name.

    Args:
        cameras: of the rig.
        shots: the records of its shots.
        units: of lengths.
        outlying: names of shots that something is told of.

    """
    axes = _upright(cameras)
    with drawing(STYLE):
        drawn = [
            _view(cameras, units, "rig-top", "The rig from above", axes.right, axes.ahead, "above"),
            _view(cameras, units, "rig-side", "The same from its right side", axes.ahead, axes.up,
                  "its right side"),
            _fields(cameras, axes),
            _shots(recorded_mappings(shots), outlying),
        ]  # fmt: skip
    return {figure.name: figure for figure in drawn if figure is not None}


def overlap_shares(cameras: Sequence[RigFileCamera]) -> FloatArray:
    """(C, C) share of all directions that two cameras both see; on the diagonal one's own."""
    sphere = all_around(20_000)
    seen = np.stack([_sees(one, sphere) for one in cameras]).astype(float)
    return np.asarray(seen @ seen.T / len(sphere))


def _upright(cameras: Sequence[RigFileCamera]) -> _Axes:
    """Up is where most photos have their top; ahead is where the first camera looks."""
    up = -np.mean([one.rotation[1] for one in cameras], axis=0)
    if np.linalg.norm(up) < 0.2:  # cameras on their sides and heads
        up = -cameras[0].rotation[1]
    up = up / np.linalg.norm(up)
    for trial in (cameras[0].rotation[2], cameras[0].rotation[0], np.eye(3)[0], np.eye(3)[1]):
        ahead = trial - up * (trial @ up)
        if np.linalg.norm(ahead) > 0.3:
            break
    ahead = ahead / np.linalg.norm(ahead)
    return _Axes(right=np.cross(ahead, up), up=up, ahead=ahead)


def colour_of(camera: int) -> str:
    """The stand-in colour of a camera."""
    return COLOURS[camera % len(COLOURS)]


def _view(
    cameras: Sequence[RigFileCamera],
    units: str,
    name: str,
    title: str,
    right: FloatArray,
    up: FloatArray,
    words: str,
) -> Drawn:
    """Cameras in a parallel view, each with the part of its field that is in the paper's plane."""
    flat = np.stack([right, up]).T
    centre = np.stack([one.position for one in cameras]) @ flat
    size = float(np.ptp(centre, axis=0).max())
    if size <= 0:  # cameras behind each other, as this view has them
        size = float(np.ptp([one.position for one in cameras], axis=0).max()) or 1.0
    reach = _REACH * size
    angle = np.deg2rad(np.arange(0, 360, _STEP_DEG))
    way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    whole = np.stack([centre.min(axis=0) - reach, centre.max(axis=0) + reach])
    figure = new_figure(_HEIGHT + _FOOT)
    axes = add_axes(figure, Box(left=4, top=4, width=WIDTH - 8, height=_HEIGHT))
    unit = at_one_scale(axes, whole, _HEIGHT)
    for number, (camera, at) in enumerate(zip(cameras, centre, strict=True)):
        seen = _sees(camera, way @ flat.T)
        nearly = np.stack([way, np.roll(way, -1, axis=0)], axis=1)[seen & np.roll(seen, -1)]
        slices = np.concatenate([np.zeros((len(nearly), 1, 2)), nearly], axis=1)
        areas(axes, at + reach * slices, colour_of(number), 0.13)
        edge = nearly[:, :2]
        strokes(axes, at + reach * edge, colour_of(number), 0.8, 0.8)
    drawn = frusta(
        np.stack([one.position for one in cameras]),
        np.stack([one.rotation for one in cameras]),
        _CAMERA * size,
    ) @ flat  # fmt: skip
    for number, (at, body) in enumerate(zip(centre, drawn, strict=True)):
        strokes(axes, body[None], colour_of(number), 1.4)
        dots(axes, at[None], colour_of(number), 4.0)
        # Beside the numbers of cameras that stand behind each other here.
        behind = int(np.sum(np.linalg.norm(centre[:number] - at, axis=1) < 12 * unit))
        place = (5 + 10 * behind, 5)
        axes.annotate(str(number + 1), at, xytext=place, textcoords="offset points", color=INK)
    length = scale_bar(figure, unit, _HEIGHT)
    return finished(
        figure,
        name=name,
        title=title,
        label=f"{len(cameras)} cameras seen from {words}",
        caption=f"The bar is {length:g} {units or 'in the units of the target'}. Shaded: what each "
        "camera sees in the plane of the picture.",
        keys=_keys(cameras),
    )


def _keys(cameras: Sequence[RigFileCamera]) -> tuple[Key, ...]:
    return tuple(
        key("area", colour_of(number), f"{number + 1} {one.name}")
        for number, one in enumerate(cameras)
    )


def _fields(cameras: Sequence[RigFileCamera], towards: _Axes) -> Drawn:
    """All directions about the rig: how many cameras see each, and where fields end."""
    longitude = np.arange(-180 + _CELL_DEG / 2, 180, _CELL_DEG)
    latitude = np.arange(90 - _CELL_DEG / 2, -90, -_CELL_DEG)
    x, y = np.meshgrid(longitude, latitude)
    count = np.sum([_sees(one, _direction(x, y, towards)) for one in cameras], axis=0)
    figure = new_figure(222)
    axes = add_axes(figure, Box(left=44, top=8, width=WIDTH - 54, height=(WIDTH - 54) / 2))
    left, top = x - _CELL_DEG / 2, y - _CELL_DEG / 2
    several = int(count.max())
    for number in range(1, several + 1):
        cells = rectangles(left[count == number], top[count == number], _CELL_DEG, _CELL_DEG)
        areas(axes, cells, INK, 0.08 + 0.5 * (number - 1) / max(several - 1, 1) * (several > 1))
    for number, one in enumerate(cameras):
        strokes(axes, _rim(one, towards), colour_of(number), 1.6)
        at = one.rotation[2]
        middle = np.array([[
            np.rad2deg(np.arctan2(at @ towards.right, at @ towards.ahead)),
            np.rad2deg(np.arcsin(np.clip(at @ towards.up, -1, 1))),
        ]])  # fmt: skip
        dots(axes, middle, colour_of(number), 4.0)
        axes.annotate(
            str(number + 1), middle[0], xytext=(4, 4), textcoords="offset points", color=INK
        )
    axes.set_xlim(-180, 180)
    axes.set_ylim(-90, 90)
    axes.set_xticks([-180, -90, 0, 90, 180])
    axes.set_yticks([-90, -45, 0, 45, 90])
    axes.set_xlabel("to the right of where the first camera looks, degrees")
    axes.set_ylabel("up, degrees")
    none, shared = (_share(choice, y) for choice in (count == 0, count > 1))
    return finished(
        figure,
        name="rig-fields",
        title="What the cameras see of all around",
        label=f"The fields of {len(cameras)} cameras",
        caption=f"Dots: where cameras look; lines: where their fields end; darker: seen by more. "
        f"{100 * none:.0f} % of all directions are seen by no camera, {100 * shared:.0f} % by two "
        "or more.",
        keys=_keys(cameras),
    )


def _direction(longitude: FloatArray, latitude: FloatArray, towards: _Axes) -> FloatArray:
    """Unit vectors in the rig's frame of directions in degrees."""
    turn, rise = np.deg2rad(longitude)[..., None], np.deg2rad(latitude)[..., None]
    level = np.cos(turn) * towards.ahead + np.sin(turn) * towards.right
    return np.asarray(np.cos(rise) * level + np.sin(rise) * towards.up)


def _rim(camera: RigFileCamera, towards: _Axes) -> FloatArray:
    """Short strokes (N, 2, 2) along the end of a field, none across the picture's edge."""
    angle = np.linspace(0, 2 * np.pi, 361)[:, None]
    half = np.deg2rad(_half_field_deg(camera))
    x, y, z = camera.rotation
    way = np.cos(half) * z + np.sin(half) * (np.cos(angle) * x + np.sin(angle) * y)
    at = np.stack(
        [
            np.rad2deg(np.arctan2(way @ towards.right, way @ towards.ahead)),
            np.rad2deg(np.arcsin(np.clip(way @ towards.up, -1, 1))),
        ],
        axis=-1,
    )
    ends = np.stack([at[:-1], at[1:]], axis=1)
    return ends[np.abs(ends[:, 1, 0] - ends[:, 0, 0]) < 90]


def _share(chosen: BoolArray, latitude: FloatArray) -> float:
    weight = np.cos(np.deg2rad(latitude))
    return float(weight[chosen].sum() / weight.sum())


def _shots(records: Sequence[Mapping[str, Any]], outlying: Sequence[str]) -> Drawn | None:
    """RMS of each shot, in their order."""
    known = [
        (number, rms, str(record.get("shot")))
        for number, record in enumerate(records, start=1)
        if (rms := recorded_number(record.get("rms_px"))) is not None
    ]
    if len(known) < 2:
        return None
    at = np.array([(number, rms) for number, rms, _ in known], float)
    odd = np.array([name in outlying for _, _, name in known])
    figure = new_figure(200)
    axes = add_axes(figure, Box(left=60, top=8, width=WIDTH - 70, height=152))
    axes.grid(True)
    usual = float(np.median(at[:, 1]))
    strokes(axes, np.array([[[0, usual], [len(records) + 1, usual]]]), MUTED, 0.9)
    dots(axes, at[~odd], BOARD_COLOURS[0], 4.0)
    dots(axes, at[odd], RED, 6.0)
    axes.set_xlim(0, len(records) + 1)
    axes.set_ylim(0, 1.15 * float(at[:, 1].max()))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("shot")
    axes.set_ylabel("RMS, px")
    keys = (key("dot", RED, "something is told of it"),) if odd.any() else ()
    return finished(
        figure,
        name="rig-shots",
        title="Errors of the shots, in their order",
        label=f"RMS error of {len(known)} shots",
        caption=f"The line is the usual shot, {usual:.3f} px. A step means that a camera moved.",
        keys=keys,
    )
