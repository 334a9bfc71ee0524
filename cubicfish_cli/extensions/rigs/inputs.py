"""What is read of each camera of a rig."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cubicfish import CameraFile, CorrespondenceError, Run, load_camera
from cubicfish.files import Fingerprint
from cubicfish_cli.inputs.paths import check_inputs, kind_of_inputs
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.observe import Inputs, load_inputs


def check_camera_inputs(cameras: Sequence[Path], target: TargetSource, run: Run) -> bool:
    """Refuse at once what cannot be read of cameras' photos or tables, or says nothing here.

    Returns:
        Whether one has 2D-3D pairs, which have no target.

    Raises:
        UsageError: the inputs do not go together, or an option would have no effect.
        CubicfishError: one is not there.

    """
    inputs = [_find_model_and_corners(path)[1] for path in cameras]
    kinds = [kind_of_inputs([one]) for one in inputs]
    for kind, one in zip(kinds, inputs, strict=True):
        check_inputs(kind, [one], target, Run() if "photos" in kinds else run)
    return "points" in kinds


def is_calibrated(path: Path) -> bool:
    """Whether a camera's input is its calibration: the folder or the camera.yaml in it."""
    return _find_model_and_corners(path)[0] is not None


def _find_model_and_corners(path: Path) -> tuple[Path | None, Path]:
    """The file of a camera that is calibrated already, and its corners; or None and its input."""
    model = path / "camera.yaml" if path.is_dir() else path
    if not (model.suffix in (".yaml", ".yml") and model.is_file()):
        return None, path
    corners = model.parent / "corners.csv"
    if not corners.is_file():
        raise CorrespondenceError(
            f"{model.parent} has a camera.yaml and no corners.csv: calibrate it again, or name the "
            "camera's photos or its corners.csv"
        )
    return model, corners


def read_for(cameras: Sequence[Path]) -> list[Path]:
    """What is read for cameras."""
    both = [one for path in cameras for one in _find_model_and_corners(path)]
    return [path for path in both if path is not None]


def load_camera_inputs(
    sources: Sequence[Path], target: TargetSource, run: Run
) -> tuple[Inputs, CameraFile | None]:
    """One camera's pairs, and its lens where it is calibrated already."""
    model, first = _find_model_and_corners(sources[0])
    inputs = [first, *sources[1:]]
    loaded = load_inputs(kind_of_inputs(inputs), inputs, target, run)
    run.listener.found(loaded.photo_findings)
    if model is None:
        return loaded, None
    return replace(loaded, files=(*loaded.files, Fingerprint.of(model))), load_camera(model)
