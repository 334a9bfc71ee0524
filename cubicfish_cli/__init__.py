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
    "core.observations": ("Observations",),
    "core.io.observations_csv": ("load_corners", "save_corners"),
    "core.errors": ("CubicfishError",),
    "core.fit.calibrate": ("Calibration",),
    "app.comparison": ("Comparison", "compare"),
    "core.fit.evaluate": ("Evaluation",),
    "core.assess.verdict": ("Verdict",),
    "core.io.camera_yaml": ("CameraFile", "load_any_camera", "load_camera"),
    "app.run": ("Run",),
    "extensions.advice.command": ("AdviseOptions", "advise_files"),
    "commands.calibrate": ("CalibrateOptions", "calibrate_files"),
    "extensions.formats.corners": ("CornersOptions", "import_corner_files"),
    "commands.detect": ("DetectOptions", "detect_files"),
    "extensions.films.command": ("ChosenFrames", "FramesOptions", "choose_frames"),
    "extensions.formats.import_camera": ("ImportOptions", "import_files"),
    "extensions.simulation.command": ("LookOptions", "SimulateOptions", "simulate_files"),
    "commands.target": ("CheckOptions", "check_target", "check_target_files"),
    "extensions.printing.command": ("PrintOptions", "print_target_files"),
    "commands.evaluate": ("EvaluateOptions", "evaluate_files"),
    "commands.compare": ("CompareOptions", "compare_files"),
    "commands.export": ("ExportOptions", "export_files"),
    "commands.info": ("InfoOptions", "info_files"),
    "commands.map": ("MapOptions", "map_files"),
    "extensions.report.command": ("ReportOptions", "report_files"),
    "app.listener": ("Event", "Listener"),
    "core.finding": ("Finding",),
    "commands.undistort": ("UndistortOptions", "undistort_files"),
    "commands.calibration": (
        "calibrate",
        "evaluate",
        "save_camera",
        "save_target",
    ),
    "app.detection": ("detect",),
    "commands.exporting": ("export_camera",),
    "extensions.formats.importing": ("import_camera",),
    "app.undistortion.images": ("undistort",),
    "extensions.rigs.calibrate": ("RigOptions", "calibrate_rig_files"),
    "extensions.rigs.compare": ("RigCompareOptions", "compare_rig_files"),
    "extensions.rigs.evaluate": ("RigEvaluateOptions", "evaluate_rig_files"),
    "extensions.rigs.export": ("RigExportOptions", "export_rig_files"),
    "extensions.rigs.fit.calibrate": ("calibrate_rig",),
    "extensions.rigs.fit.compare": ("compare_rigs",),
    "extensions.rigs.fit.evaluate": ("evaluate_rig",),
    "extensions.rigs.info": ("RigInfoOptions", "info_rig_files"),
    "extensions.rigs.mosaic": ("stitch",),
    "extensions.rigs.map": ("RigMapOptions", "map_rig_files"),
    "extensions.rigs.report": ("RigReportOptions", "report_rig_files"),
    "extensions.rigs.rig": ("Rig", "load_rig", "save_rig"),
    "extensions.rigs.stereo": ("RectifiedPair", "rectify"),
    "extensions.rigs.undistort": ("RigUndistortOptions", "undistort_rig_files"),
    "core.lenses.cubic": ("CubicCamera",),
    "corners.identification.identified": ("Detection",),
    "app.photos": ("read_picture",),
    "core.target": ("Target",),
    "app.undistortion.choose": ("build_view",),
    "app.undistortion.options": ("PlaneOptions", "ViewOptions"),
    "core.views.plane": ("build_plane",),
    "core.views.maps": ("UndistortMap", "build_map"),
    "app.undistortion.map_formats": ("save_map",),
    "core.views.view": ("View",),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    """Load a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value: object = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
