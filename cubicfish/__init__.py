"""cubicfish: fisheye calibration with the cubic polynomial camera of Zhu & Yin (2010).

In a program::

    from cubicfish import Target, calibrate, detect, undistort

    target = Target.load("target.yaml")
    calibration = calibrate(detect("photos/", target), target)
    flat = undistort(photo, calibration.camera)

What the names below offer is described in docs/library.md. They are loaded when they are first
used, so that importing the package loads nothing else. Nothing here prints, and of these names
only what is called ``save`` or ``save_...`` writes files that stay.

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

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__, checked=True)
