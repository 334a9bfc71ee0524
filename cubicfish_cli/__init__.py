"""cubicfish: fisheye calibration with the cubic polynomial camera of Zhu & Yin (2010).

In a program::

    from cubicfish_cli import Target, calibrate, detect, undistort

    target = Target.load("target.yaml")
    calibration = calibrate(detect("photos/", target), target)
    flat = undistort(photo, calibration.camera)

What the names below offer is described in docs/library.md. They are loaded when they are first
used, so that importing the package loads nothing else. Nothing here prints, and files are written
by ``choose_frames`` and what is called ``..._files``, ``save`` or ``save_...`` alone.

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

# Where each public name is; __init__.pyi tells type checkers. Nothing at all is loaded by this
# file: while it is, Ctrl-C would still end in a traceback.
_PLACES = {
    "cubicfish.target.observations": ("Observations",),
    "cubicfish.io.corners_csv": ("load_corners", "save_corners"),
    "cubicfish.errors": ("CubicfishError",),
    "cubicfish.fit.calibrate": ("Calibration",),
    "cubicfish.comparison": ("Comparison", "compare"),
    "cubicfish.fit.evaluate": ("Evaluation",),
    "cubicfish.judge.verdict": ("Verdict",),
    "cubicfish.io.camera_yaml": ("CameraFile", "load_any_camera", "load_camera"),
    "cubicfish.run": ("Run",),
    "cubicfish_cli.extensions.advice.command": ("AdviseOptions", "advise_files"),
    "cubicfish_cli.commands.calibrate": ("CalibrateOptions", "calibrate_files"),
    "cubicfish_cli.extensions.formats.corners": ("CornersOptions", "import_corner_files"),
    "cubicfish_cli.commands.detect": ("DetectOptions", "detect_files"),
    "cubicfish_cli.extensions.films.command": ("ChosenFrames", "FramesOptions", "choose_frames"),
    "cubicfish_cli.extensions.formats.import_camera": ("ImportOptions", "import_files"),
    "cubicfish_cli.extensions.simulation.command": (
        "LookOptions",
        "SimulateOptions",
        "simulate_files",
    ),
    "cubicfish_cli.commands.target": ("CheckOptions", "check_target", "check_target_files"),
    "cubicfish_cli.extensions.printing.command": ("PrintOptions", "print_target_files"),
    "cubicfish_cli.commands.evaluate": ("EvaluateOptions", "evaluate_files"),
    "cubicfish_cli.commands.compare": ("CompareOptions", "compare_files"),
    "cubicfish_cli.commands.export": ("ExportOptions", "export_files"),
    "cubicfish_cli.commands.info": ("InfoOptions", "info_files"),
    "cubicfish_cli.commands.map": ("MapOptions", "map_files"),
    "cubicfish_cli.extensions.report.command": ("ReportOptions", "report_files"),
    "cubicfish.listener": ("Event", "Listener"),
    "cubicfish.judge.finding": ("Finding",),
    "cubicfish_cli.commands.undistort": ("UndistortOptions", "undistort_files"),
    "cubicfish.calibration": ("calibrate", "evaluate", "save_camera", "save_target"),
    "cubicfish.observe.detection": ("detect",),
    "cubicfish_cli.commands.exporting": ("export_camera",),
    "cubicfish_cli.extensions.formats.importing": ("import_camera",),
    "cubicfish_cli.undistortion.images": ("undistort",),
    "cubicfish_cli.extensions.rigs.calibrate": ("RigOptions", "calibrate_rig_files"),
    "cubicfish_cli.extensions.rigs.compare": ("RigCompareOptions", "compare_rig_files"),
    "cubicfish_cli.extensions.rigs.evaluate": ("RigEvaluateOptions", "evaluate_rig_files"),
    "cubicfish_cli.extensions.rigs.export": ("RigExportOptions", "export_rig_files"),
    "cubicfish.rigs.calibrate": ("calibrate_rig",),
    "cubicfish.rigs.compare": ("compare_rigs",),
    "cubicfish.rigs.evaluate": ("evaluate_rig",),
    "cubicfish_cli.extensions.rigs.info": ("RigInfoOptions", "info_rig_files"),
    "cubicfish_cli.extensions.rigs.panorama": ("stitch",),
    "cubicfish_cli.extensions.rigs.map": ("RigMapOptions", "map_rig_files"),
    "cubicfish_cli.extensions.rigs.report": ("RigReportOptions", "report_rig_files"),
    "cubicfish.rigs.rig": ("Rig", "load_rig", "save_rig"),
    "cubicfish.rigs.stereo": ("RectifiedPair", "rectify"),
    "cubicfish_cli.extensions.rigs.undistort": ("RigUndistortOptions", "undistort_rig_files"),
    "cubicfish.models.cubic": ("CubicCamera",),
    "cubicfish.find.identification.identified": ("Detection",),
    "cubicfish.photos.photos": ("read_picture",),
    "cubicfish.target.target": ("Target",),
    "cubicfish_cli.undistortion.choose": ("build_view",),
    "cubicfish_cli.undistortion.options": ("PlaneOptions", "ViewOptions"),
    "cubicfish.views.plane": ("build_plane",),
    "cubicfish.views.maps": ("UndistortMap", "build_map"),
    "cubicfish_cli.undistortion.map_formats": ("save_map",),
    "cubicfish.views.view": ("View",),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    """Load a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value: object = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
