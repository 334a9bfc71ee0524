"""cubicfish: fisheye calibration with the cubic polynomial camera of Zhu & Yin (2010).

In a program::

    from cubicfish_cli import Target, calibrate, detect, undistort

    target = Target.load("target.yaml")
    calibration = calibrate(detect("photos/", target), target)
    flat = undistort(photo, calibration.camera)

What the names below offer is described in docs/library.md. They are loaded when they are first
used, so that importing the package loads nothing else. Nothing here prints, and files are written
by the functions called ``save_...`` alone.

Conventions, the same everywhere in the package:

- Pixel (0, 0) is the centre of the top-left pixel, x to the right, y down, as in
  ``cv2.remap``. Sizes are ``(width, height)``.
- The camera frame has x to the right, y down and z forward.
- Lengths are in the target file's ``units``. Transforms are named
  ``camera_from_world``: a rotation vector (radians) and a translation.
- Angles are radians inside and degrees in files and options, where names end in ``_deg``.
- Arrays hold points along their leading axes: ``(..., 3)`` in, ``(..., 2)`` out.
"""

__version__ = "0.1.0"

# What type checkers take for true. The module that has it takes as long to load as the rest of
# what is here, while Ctrl-C would still end in a traceback: nothing at all is loaded by this file.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from cubicfish_cli.correspondences import (
        Corners,
        Correspondences,
        load_corners,
        save_corners,
    )
    from cubicfish_cli.errors import CubicfishError
    from cubicfish_cli.fitting.calibrate import Calibration
    from cubicfish_cli.fitting.comparison import Comparison
    from cubicfish_cli.fitting.comparison import compare_cameras as compare
    from cubicfish_cli.fitting.evaluate import Evaluation
    from cubicfish_cli.fitting.verdict import Verdict
    from cubicfish_cli.formats.camera_yaml import CameraFile, load_camera
    from cubicfish_cli.library.calibration import calibrate, evaluate, judge, uncertainty
    from cubicfish_cli.library.cameras import save_camera, save_target
    from cubicfish_cli.library.detection import detect
    from cubicfish_cli.library.pictures import undistort
    from cubicfish_cli.model.cubic import CubicCamera
    from cubicfish_cli.naming.detect import Detection
    from cubicfish_cli.photos import read_picture
    from cubicfish_cli.target import Target
    from cubicfish_cli.undistortion.choose import build_view
    from cubicfish_cli.undistortion.maps import UndistortMap, build_map, load_map, save_map
    from cubicfish_cli.undistortion.view import View

__all__ = [
    "Calibration",
    "CameraFile",
    "Comparison",
    "Corners",
    "Correspondences",
    "CubicCamera",
    "CubicfishError",
    "Detection",
    "Evaluation",
    "Target",
    "UndistortMap",
    "Verdict",
    "View",
    "build_map",
    "build_view",
    "calibrate",
    "compare",
    "detect",
    "evaluate",
    "judge",
    "load_camera",
    "load_corners",
    "load_map",
    "read_picture",
    "save_camera",
    "save_corners",
    "save_map",
    "save_target",
    "uncertainty",
    "undistort",
]

# Where each name is, and what it is called there if it is called otherwise.
_PLACES = {
    "correspondences": ("Corners", "Correspondences", "load_corners", "save_corners"),
    "errors": ("CubicfishError",),
    "fitting.calibrate": ("Calibration",),
    "fitting.comparison": ("Comparison", "compare"),
    "fitting.evaluate": ("Evaluation",),
    "fitting.verdict": ("Verdict",),
    "formats.camera_yaml": ("CameraFile", "load_camera"),
    "library.calibration": ("calibrate", "evaluate", "judge", "uncertainty"),
    "library.cameras": ("save_camera", "save_target"),
    "library.detection": ("detect",),
    "library.pictures": ("undistort",),
    "model.cubic": ("CubicCamera",),
    "naming.detect": ("Detection",),
    "photos": ("read_picture",),
    "target": ("Target",),
    "undistortion.choose": ("build_view",),
    "undistortion.maps": ("UndistortMap", "build_map", "load_map", "save_map"),
    "undistortion.view": ("View",),
}
_OTHERWISE = {"compare": "compare_cameras"}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> "Any":
    """Load a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), _OTHERWISE.get(name, name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
