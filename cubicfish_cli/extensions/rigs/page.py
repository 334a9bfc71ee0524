"""The page about a rig, and its figures: where cameras stand, what they see, how shots fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from cubicfish_cli.app.drawing import drawing
from cubicfish_cli.app.pages.figures import (
    BOARD_COLOURS,
    INK,
    MUTED,
    RED,
    STYLE,
    Drawn,
    Key,
    dots,
    draw_cameras,
    finished,
    new_figure,
    show_evenly,
    upright,
)
from cubicfish_cli.app.pages.template import day_of, made_of, template
from cubicfish_cli.core.assess.records import recorded_mappings, recorded_number
from cubicfish_cli.core.assess.verdict import WORDS
from cubicfish_cli.core.codes import Severity
from cubicfish_cli.core.finding import of_record
from cubicfish_cli.core.types import BoolArray, FloatArray
from cubicfish_cli.extensions.rigs.rig_yaml import RigFile, RigFileCamera
from cubicfish_cli.extensions.rigs.verdict import rig_verdict

_MOST_SHOTS = 20
COLOURS = (*BOARD_COLOURS, "#56b4e9", MUTED, INK)
# Size of a drawn camera, as a share of the rig's size.
_CAMERA = 0.14
_CELL_DEG = 4.0


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
    return template(Path(__file__).with_name("page.html")).render(
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
        pairs=_pairs(recorded_mappings(record["pairs"])),
        figures=rig_figures(seen, shots, rig.units or "", outlying),
        worst=_worst(shots),
        shots=len(shots),
        corners=recorded_number(fit.get("corners")) or 0,
        made=made_of(rig.made_by),
        day=day_of(rig.made_by),
    )


def _half_field_deg(camera: RigFileCamera) -> float:
    covered = camera.file.fit.covered_deg
    return covered if 0 < covered < 180 else camera.file.camera.max_angle_deg


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
        "colour": colour_of(number),
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


def _pairs(records: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [
        {
            "names": " + ".join(str(name) for name in record.get("cameras") or []),
            "shots": f"{recorded_number(record.get('shots')) or 0:.0f}",
            "rms": recorded_number(record.get("rms_px")),
        }
        for record in records
    ]


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
    # Up is where most photos have their top; ahead is where the first camera looks.
    turn = upright(cameras[0].rotation[2], -np.mean([one.rotation[1] for one in cameras], axis=0))
    with drawing(STYLE):
        drawn = [
            _draw_places(cameras, units, turn),
            _draw_fields(cameras, turn),
            _draw_shots(recorded_mappings(shots), outlying),
        ]
    return {figure.name: figure for figure in drawn if figure is not None}


def colour_of(camera: int) -> str:
    """The colour of a camera."""
    return COLOURS[camera % len(COLOURS)]


def _draw_places(cameras: Sequence[RigFileCamera], units: str, turn: FloatArray) -> Drawn:
    """Where the cameras stand and look."""
    at = np.stack([one.position for one in cameras]) @ turn.T
    rotation = np.stack([one.rotation for one in cameras]) @ turn.T
    size = _CAMERA * (float(np.ptp(at, axis=0).max()) or 1.0)
    colours = [colour_of(number) for number in range(len(cameras))]
    figure = new_figure(4.2)
    axes = figure.add_subplot(projection="3d")
    draw_cameras(axes, at, rotation, size, colours)
    for number, place in enumerate(at, start=1):
        axes.text(*place, str(number))
    show_evenly(axes, np.concatenate([at, at + size * rotation[:, 2]]), 30, -60)
    return finished(
        figure,
        name="rig-places",
        title="The rig",
        label=f"{len(cameras)} cameras in space",
        caption=f"Lengths are in {units or 'the units of the target'}; open sides look ahead.",
        keys=_keys(cameras),
    )


def _keys(cameras: Sequence[RigFileCamera]) -> tuple[Key, ...]:
    return tuple(
        Key(kind="area", colour=colour_of(number), text=f"{number + 1} {one.name}")
        for number, one in enumerate(cameras)
    )


def _draw_fields(cameras: Sequence[RigFileCamera], turn: FloatArray) -> Drawn:
    """All directions about the rig: how many cameras see each, and where each looks."""
    longitude = np.arange(-180 + _CELL_DEG / 2, 180, _CELL_DEG)
    latitude = np.arange(-90 + _CELL_DEG / 2, 90, _CELL_DEG)
    x, y = np.meshgrid(longitude, latitude)
    across, rise = np.deg2rad(x), np.deg2rad(y)
    level = np.cos(rise)
    way = np.stack([level * np.sin(across), level * np.cos(across), np.sin(rise)], axis=-1) @ turn
    seen = np.stack([_sees(one, way) for one in cameras])
    count = seen.sum(axis=0)
    figure = new_figure(3.1)
    axes = figure.add_subplot()
    reach, most = (-180.0, 180.0, -90.0, 90.0), 2 * max(len(cameras), 2)
    axes.imshow(count, cmap="Greys", origin="lower", extent=reach, vmin=0, vmax=most)
    for number, (one, own) in enumerate(zip(cameras, seen, strict=True)):
        axes.contour(x, y, own.astype(float), [0.5], colors=colour_of(number), linewidths=1.6)
        right, ahead, up = np.clip(turn @ one.rotation[2], -1, 1)
        at = (float(np.rad2deg(np.arctan2(right, ahead))), float(np.rad2deg(np.arcsin(up))))
        axes.plot(*at, marker="o", markersize=4, color=colour_of(number))
        axes.annotate(str(number + 1), at, xytext=(4, 4), textcoords="offset points")
    axes.set(xlim=(-180, 180), ylim=(-90, 90))
    axes.set(xticks=[-180, -90, 0, 90, 180], yticks=[-90, -45, 0, 45, 90])
    axes.set(xlabel="to the right of where the first camera looks, degrees", ylabel="up, degrees")
    none, shared = (float(level[own].sum() / level.sum()) for own in (count == 0, count > 1))
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


def _draw_shots(records: Sequence[Mapping[str, Any]], outlying: Sequence[str]) -> Drawn | None:
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
    usual = float(np.median(at[:, 1]))
    figure = new_figure(2.8)
    axes = figure.add_subplot()
    axes.grid(True)
    axes.axhline(usual, color=MUTED, linewidth=0.9)
    dots(axes, at[~odd], BOARD_COLOURS[0], 4.0)
    dots(axes, at[odd], RED, 6.0)
    axes.set(xlim=(0, len(records) + 1), ylim=(0, 1.15 * float(at[:, 1].max()) or 1.0))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(xlabel="shot", ylabel="RMS, px")
    keys = (Key(kind="dot", colour=RED, text="something is told of it"),) if odd.any() else ()
    return finished(
        figure,
        name="rig-shots",
        title="Errors of the shots, in their order",
        label=f"RMS error of {len(known)} shots",
        caption=f"The line is the usual shot, {usual:.3f} px. A step means that a camera moved.",
        keys=keys,
    )
