"""The page about a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cubicfish_cli.assess.records import recorded_mappings, recorded_number
from cubicfish_cli.assess.rig_verdict import rig_verdict
from cubicfish_cli.assess.verdict import WORDS
from cubicfish_cli.formats.rig_yaml import RigFile, RigFileCamera
from cubicfish_cli.report.figures import key
from cubicfish_cli.report.page import day_of, made_of, template
from cubicfish_cli.report.rig_figures import SeenCamera, colour_of, overlap_shares, rig_figures
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
    seen = [_seen(one) for one in rig.cameras]
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


def _seen(camera: RigFileCamera) -> SeenCamera:
    return SeenCamera(
        name=camera.name,
        rotation=camera.rotation,
        position=-camera.rotation.T @ camera.translation,
        half_field_deg=_half_field_deg(camera),
    )


def _half_field_deg(camera: RigFileCamera) -> float:
    covered = recorded_number(camera.file.fit.get("covered_deg"))
    return covered if covered and 0 < covered < 180 else camera.file.camera.max_angle_deg


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
    records: Sequence[Mapping[str, Any]], cameras: Sequence[SeenCamera]
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
