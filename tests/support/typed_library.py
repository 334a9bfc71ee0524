"""A program that uses the library, for mypy: it is checked with the package, and never run."""

from pathlib import Path
from typing import Any, assert_type

import numpy as np
import numpy.typing as npt

import cubicfish
from cubicfish_cli import (
    Calibration,
    CameraFile,
    Comparison,
    CubicCamera,
    CubicfishError,
    Detection,
    Evaluation,
    Listener,
    Observations,
    Run,
    Target,
    UndistortMap,
    Verdict,
    View,
    build_map,
    build_view,
    calibrate,
    compare,
    detect,
    evaluate,
    load_camera,
    load_corners,
    read_picture,
    save_camera,
    save_corners,
    save_map,
    save_target,
    undistort,
)

Floats = npt.NDArray[np.float64]


def fits(folder: Path, pictures: dict[str, npt.NDArray[np.uint8]]) -> Calibration | None:
    target = assert_type(Target.load(folder / "target.yaml"), Target)
    target = Target.from_data({"units": "mm", "boards": []})
    assert_type(target.corners()[3], Floats)
    detection = assert_type(detect(pictures, target, Run(jobs=None)), Detection)
    detect("photos/", target)
    detect([folder / "a.png", folder / "b.png"], target)
    detect([np.zeros((4, 4), np.uint8)], target, Run(listener=Listener()))
    corners = assert_type(load_corners(folder / "corners.csv", target), Observations)
    points, pixel = [np.zeros((9, 3))], [np.zeros((9, 2), np.float32)]
    seen = Observations.from_corners(points, pixel, (4, 4), boards=["board"])
    assert_type(seen.of("photo_0").with_target(target).select(seen.certain), Observations)
    pairs = assert_type(Observations.from_points(points, pixel, (4, 4)), Observations)
    assert_type(pairs.world, Floats)
    try:
        calibration = assert_type(calibrate(pairs, hold_out=False), Calibration)
        calibration = calibrate(corners, target, refine_target="shape")
    except CubicfishError:
        return None
    evaluation = assert_type(evaluate(calibration.camera, detection, target), Evaluation)
    assert_type(evaluation.errors.rms_px, float)
    assert_type(calibration.poses.rotation, Floats)
    if calibration.target is not None:
        save_target("target.yaml", calibration.target)
    save_corners("corners.csv", corners)
    save_camera("camera.yaml", calibration, overwrite=True)
    return calibration


def uses(picture: npt.NDArray[np.uint8]) -> Floats:
    loaded = assert_type(load_camera("camera.yaml"), CameraFile)
    camera = assert_type(loaded.camera, CubicCamera)
    assert_type(loaded.verdict, Verdict)
    assert_type(cubicfish.Calibration.load("camera.yaml").verdict, Verdict)
    assert_type(loaded.uncertainty([[1, 2]]), Floats)
    assert_type(compare(camera, camera), Comparison)
    seen, slope = camera.project_jacobian([0, 0, 1])
    assert_type(slope, Floats)
    view: View = build_view(camera, "cylindrical", fit="outer")
    made = assert_type(build_map(camera, view), UndistortMap)
    save_map("map.npz", made)
    assert_type(undistort(picture, made, interpolation="cubic"), npt.NDArray[Any])
    undistort(read_picture("photo.png"), camera, view)
    return assert_type(camera.unproject(seen), Floats)


def mistakes(camera: CubicCamera) -> None:
    """Each of these is one, and mypy says so: else it would call its comment unused."""
    build_view(camera, "round")  # type: ignore[arg-type]
    undistort("photo.png", camera)  # type: ignore[arg-type]
    calibrate([[1, 2, 3]])  # type: ignore[arg-type]
    camera.undistort()  # type: ignore[attr-defined]
