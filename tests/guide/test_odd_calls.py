"""Public functions with odd arguments: what a caller gets wrong ends in an error of one line."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from lenses import smaller
from samples import SAMPLE
from simulated import CornerErrors
from simulated_rig import corner_target, simulated_rig
from synthetic_lenses import synthetic_lens

import cubicfish
import cubicfish_cli
from cubicfish import Calibration, CubicfishError, Observations, Run, Target
from cubicfish_cli import ViewOptions

ODD: Mapping[str, Any] = {
    "None": None, "empty text": "", "text": "nonsense", "no file": "there/is/none.yaml",
    "no path": Path("none.yaml"), "the folder": Path(), "bytes": b"x", "a null": "\0",
    "0": 0, "-1": -1, "3": 3, "1e300": 1e300, "10**30": 10**30, "NaN": float("nan"),
    "infinity": float("inf"), "True": True, "False": False,
    "no list": [], "no mapping": {}, "no tuple": (), "list of None": [None], "list of text": ["a"],
    "list of -1": [-1, -1], "list of NaN": [float("nan")] * 3, "list of no list": [[]],
    "mapping to None": {"a": None}, "mapping to an object": {"a": object()},
    "mapping of None": {None: 1}, "mapping of lists": {"a": []},
    "an object": object(), "a function": len, "a class": dict, "a set": {1}, "an error": OSError(),
    "no array": np.array([]), "square": np.zeros((2, 2)), "NaNs": np.full((3, 3), np.nan),
    "text in an array": np.array(["a"]), "objects": np.array([None]), "0-d": np.array(0.5),
}  # fmt: skip


@cache
def small_rig() -> tuple[dict[str, Observations], Target, cubicfish.Rig]:
    target = corner_target()
    lens = replace(synthetic_lens("equisolid", (960, 720)), max_angle_deg=95.0)
    places = [(np.zeros(3), np.zeros(3)), (np.array([0.02, 0.1, -0.03]), np.array([-120.0, 4, 6]))]
    corners, _ = simulated_rig(
        [lens, lens], places, target, 4, distances=(50, 300), middle=(330, 330, 300),
        errors=CornerErrors(noise=0.1, shared=0, spread=0),
    )  # fmt: skip
    cameras = dict(zip(("left", "right"), corners, strict=True))
    return cameras, target, cubicfish.calibrate_rig(cameras, target, refine_target="off")


@pytest.fixture
def known(fitted: Calibration, calibrated: Path, tmp_path: Path) -> dict[str, Any]:
    """Sound arguments by names that functions have for them."""
    cameras, rig_target, rig = small_rig()
    target = Target.load(SAMPLE / "target.yaml")
    camera = smaller(fitted.camera, 8)
    picture = np.zeros((90, 120), np.uint8)
    view = cubicfish_cli.build_view(camera, size=(12, 9))
    rig_folder = tmp_path / "rig"
    cubicfish.save_rig(rig_folder, rig)
    photo = tmp_path / "left" / "1.png"
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "1.png"), np.zeros((720, 960), np.uint8))
    table, file = SAMPLE / "true_corners.csv", calibrated / "camera.yaml"
    pose = fitted.poses
    few = tmp_path / "few.csv"  # which no camera can be fitted to
    few.write_text("".join(table.read_text().splitlines(keepends=True)[:50]))
    return {
        "out": tmp_path / "out", "camera": camera, "target": target, "view": view,
        "board": "floor", "rotation": pose.rotation[0], "translation": pose.translation[0],
        "corners": cubicfish.load_corners(table, target), "cameras": cameras, "rig": rig,
        "rig_target": rig_target, "fitted": fitted, "picture": picture, "photo": photo,
        "table": table, "file": file, "rig_folder": rig_folder, "small": view,
        "map": cubicfish.build_map(camera, view), "calibrated": calibrated,
        "few": few, "target_file": SAMPLE / "target.yaml",
    }  # fmt: skip


Known = Mapping[str, Any]
OPTIONS: dict[str, Callable[[Known], dict[str, Any]]] = {
    "advise_files": lambda k: {"camera": k["calibrated"]},
    "calibrate_files": lambda k: {
        "inputs": k["table"], "target": k["target"], "folder": k["out"], "hold_out": False,
        "report": False,
    },
    "calibrate_rig_files": lambda k: {
        "cameras": {"left": k["few"], "right": k["few"]}, "target": k["target"],
        "folder": k["out"], "refine_target": "off", "report": False,
    },
    "check_target_files": lambda k: {"target": k["target_file"]},
    "choose_frames": lambda k: {"films": "none.mp4", "target": k["target"], "folder": k["out"]},
    "compare_files": lambda k: {"first": k["file"], "second": k["file"]},
    "compare_rig_files": lambda k: {"first": k["rig_folder"], "second": k["rig_folder"]},
    "detect_files": lambda k: {"photos": k["photo"], "target": k["target"], "table": k["out"]},
    "evaluate_files": lambda k: {"inputs": k["table"], "target": k["target"], "camera": k["file"]},
    "evaluate_rig_files": lambda k: {"rig": k["rig_folder"], "cameras": [k["table"], k["table"]]},
    "export_files": lambda k: {"to": "mrcal", "camera": k["file"], "output": k["out"]},
    "export_rig_files": lambda k: {"to": "kalibr", "rig": k["rig_folder"], "output": k["out"]},
    "import_corner_files": lambda k: {
        "files": "none.vnl", "target": k["target"], "table": k["out"], "image_size": (96, 72)
    },
    "import_files": lambda k: {"path": k["file"], "output": k["out"]},
    "info_files": lambda k: {"camera": k["file"]},
    "info_rig_files": lambda k: {"rig": k["rig_folder"]},
    "map_files": lambda k: {
        "output": k["out"].with_suffix(".npz"), "camera": k["file"],
        "view": ViewOptions(size=(12, 9)),
    },
    "map_rig_files": lambda k: {
        "output": k["out"].with_suffix(".npz"), "rig": k["rig_folder"],
        "view": ViewOptions(size=(12, 9)),
    },
    "print_target_files": lambda k: {"folder": k["out"], "paper": "A3", "kind": "board"},
    "report_files": lambda k: {"camera": k["calibrated"], "page": k["out"]},
    "report_rig_files": lambda k: {"rig": k["rig_folder"], "page": k["out"]},
    "simulate_files": lambda k: {
        "target": k["target"], "camera": k["camera"], "folder": k["out"], "number": 1
    },
    "undistort_files": lambda k: {
        "photos": k["photo"], "output": k["out"].with_suffix(".png"), "camera": k["file"],
        "view": ViewOptions(size=(12, 9)),
    },
    "undistort_rig_files": lambda k: {
        "photos": [k["photo"].parents[1] / "left", k["photo"].parents[1] / "right"],
        "output": k["out"], "rig": k["rig_folder"], "view": ViewOptions(size=(24, 12)),
    },
}  # fmt: skip
"""Options of functions that work on files, by their names: sound ones."""
RUNS = ("detect_files", "info_files")
"""Functions that are asked for every odd way of working."""
ARGUMENTS: dict[str, Callable[[Known], dict[str, Any]]] = {
    "aligned_difference": lambda k: {
        "first": k["camera"], "second": k["camera"], "rays": k["view"].rays([[3, 3], [8, 8]])
    },
    "build_map": lambda k: {"camera": k["camera"], "view": k["view"]},
    "build_plane": lambda k: {
        **{name: k[name] for name in ("camera", "target", "board", "rotation", "translation")},
        "pixels_per_unit": 0.05,
    },
    "build_view": lambda k: {"camera": k["camera"], "size": (12, 9)},
    "calibrate": lambda k: {"corners": k["corners"], "target": k["target"], "hold_out": False},
    "calibrate_rig": lambda k: {
        "cameras": k["cameras"], "target": k["rig_target"], "refine_target": "off"
    },
    "check_target": lambda k: {"target": k["target"]},
    "compare": lambda k: {"first": k["camera"], "second": k["camera"]},
    "compare_rigs": lambda k: {"first": k["rig"], "second": k["rig"]},
    "detect": lambda k: {"photos": {"a": k["picture"]}, "target": k["target"]},
    "evaluate": lambda k: {"camera": k["fitted"].camera, "corners": k["corners"]},
    "evaluate_rig": lambda k: {"rig": k["rig"], "cameras": k["cameras"]},
    "export_camera": lambda k: {"calibrated": k["fitted"], "to": "mrcal"},
    "import_camera": lambda k: {"path": k["file"]},
    "load_camera": lambda k: {"path": k["file"]},
    "load_corners": lambda k: {"path": k["table"], "target": k["target"]},
    "load_rig": lambda k: {"given": k["rig_folder"]},
    "read_picture": lambda k: {"path": k["photo"]},
    "rectify": lambda k: {"rig": k["rig"], "first": "left", "second": "right"},
    "save_camera": lambda k: {"path": k["out"], "camera": k["fitted"]},
    "save_corners": lambda k: {"path": k["out"], "corners": k["corners"]},
    "save_map": lambda k: {"path": k["out"].with_suffix(".npz"), "undistort_map": k["map"]},
    "save_rig": lambda k: {"folder": k["out"], "rig": k["rig"]},
    "save_target": lambda k: {"path": k["out"], "target": k["target"]},
    "stitch": lambda k: {
        "rig": k["rig"], "photos": dict.fromkeys(("left", "right"), np.zeros((720, 960), np.uint8)),
        "view": cubicfish_cli.build_view(k["camera"], size=(12, 9)),
    },
    "undistort": lambda k: {"picture": k["picture"], "by": k["camera"], "view": k["view"]},
}  # fmt: skip
"""Arguments of all other functions."""


def functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    for face in (cubicfish, cubicfish_cli):
        for name in face.__all__:
            thing = getattr(face, name)
            if hasattr(thing, "checked_arguments"):
                yield name, thing


def outcome(call: Callable[[], Any]) -> str:
    """What is wrong with how a call ends; empty where nothing is."""
    try:
        call()
    except CubicfishError as error:
        said = str(error)
        return "" if said and said.isprintable() and len(said) < 1000 else repr(said)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def odd_calls(
    function: Callable[..., Any], known: Known
) -> Iterator[tuple[str, Callable[[], Any]]]:
    name = function.__name__
    if name in ARGUMENTS:
        sound = ARGUMENTS[name](known)
        for parameter in inspect.signature(function).parameters:
            for odd, value in ODD.items():
                given = {**sound, parameter: value}
                yield f"{parameter}={odd}", lambda given=given: function(**given)
        return
    kind = next(iter(inspect.signature(function).parameters.values())).annotation
    record = getattr(cubicfish_cli, kind)
    sound = OPTIONS[name](known)
    run = Run(overwrite=True)
    for odd, value in ODD.items():
        yield f"options={odd}", lambda value=value: function(value)
        yield f"run={odd}", lambda value=value: function(record(**sound), run=value)
        for field in fields(record):
            given = {**sound, field.name: value}
            yield (
                f"options.{field.name}={odd}",
                lambda given=given: function(record(**given), run=run),
            )
    for field in fields(Run) if name in RUNS else ():
        for odd, value in ODD.items():
            given = {"overwrite": True, field.name: value}
            yield (
                f"run.{field.name}={odd}",
                lambda given=given: function(record(**sound), run=Run(**given)),
            )


HEAVY = {"calibrate_rig", "export_camera", "export_files", "print_target_files", "stitch"}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name in HEAVY))
        for name in sorted({name for name, _ in functions()})
    ],
)
@pytest.mark.usefixtures("quick_fit")
def test_odd_arguments_end_in_one_line(
    name: str, known: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    function = dict(functions())[name]
    wrong = {}
    for what, call in odd_calls(function, known):
        if said := outcome(call):
            wrong[what] = said
    assert wrong == {}
