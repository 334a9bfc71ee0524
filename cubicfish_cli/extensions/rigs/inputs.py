"""What the cameras of a rig are called by their files, and what is read of each."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from glob import has_magic
from pathlib import Path

from cubicfish_cli.app.asked import RUN, Run, TargetSource, check_inputs
from cubicfish_cli.app.films.recordings import is_recording, label_of
from cubicfish_cli.app.fingerprint import fingerprint
from cubicfish_cli.app.inputs import Inputs, load_inputs
from cubicfish_cli.app.photos import VIDEO_SUFFIXES
from cubicfish_cli.core.errors import CorrespondenceError
from cubicfish_cli.core.io.camera_yaml import CameraFile, load_camera


def named_by(path: Path) -> str:
    """What a camera is called by where its photos are, or its calibration is."""
    path = path.absolute()
    path = path.parent if path.name in ("corners.csv", "camera.yaml") else path
    if is_recording(path):
        return label_of(path)
    if has_magic(path.name) and not path.exists():  # left*.png, or left/*.png
        begin = re.split(r"[*?[]", path.name)[0].rstrip("_-. ")
        return begin or path.parent.name
    suffix = path.suffix.lower()
    return path.stem if suffix == ".csv" or suffix in VIDEO_SUFFIXES else path.name


def load_camera_inputs(
    sources: Sequence[Path], target: TargetSource, run: Run
) -> tuple[Inputs, CameraFile | None]:
    """One camera's pairs, and its lens where it is calibrated already."""
    camera, path = None, sources[0] if sources else Path()
    model = path / "camera.yaml" if path.is_dir() else path
    if model.name.endswith((".yaml", ".yml")) and model.is_file():
        camera = load_camera(model)
        sources = [model.parent / "corners.csv"]
        if not sources[0].is_file():
            raise CorrespondenceError(
                f"{model.parent} has a camera.yaml and no corners.csv: calibrate it again, or name "
                "the camera's photos or its corners.csv"
            )
    check_inputs(sources, target, RUN)
    loaded = load_inputs(sources, target, run)
    run.listener.found(loaded.photo_findings)
    if camera is not None:
        loaded = replace(loaded, files=(*loaded.files, fingerprint(model)))
    return loaded, camera
