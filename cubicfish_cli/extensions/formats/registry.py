"""Every camera format. A new one is a module beside this one, with its ``FORMAT``, and a line here.

Nothing heavy is imported here: ``--help`` tells the names.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Entry(NamedTuple):
    """A format by its names.

    Attributes:
        module: of this folder; its ``FORMAT`` is a
            :class:`~cubicfish_cli.core.io.camera_format.CameraFormat`.
        written: names that it is written under, and what comes of each.
        read: the name that it is read under; None where it is only written.
        reads: what is read.

    """

    module: str
    written: Mapping[str, str]
    read: str | None = None
    reads: str = ""


_KALIBR = {
    "kalibr-pinhole-equi": "camchain.yaml",
    "kalibr-omni": "camchain.yaml; the nearest of Kalibr's",
    "kalibr-ds": "camchain.yaml",
}
_COLMAP = {
    "colmap": "cameras.txt; OPENCV_FISHEYE",
    "colmap-rad-tan-thin-prism-fisheye": "cameras.txt; the nearest of COLMAP's",
}
ENTRIES = (
    Entry("opencv_cameras", {"opencv": "K and D of cv2.fisheye, YAML"},
          "opencv", "OpenCV's FileStorage (YAML, XML, JSON)"),
    Entry("ros_yaml", {"ros": "camera_info.yaml"}, "ros", "ROS CameraInfo"),
    Entry("kalibr_yaml", _KALIBR, "kalibr", "Kalibr's camchain"),
    Entry("ocamcalib", {"ocamcalib": "calib_results.txt"}, "ocamcalib", "OCamCalib's text"),
    Entry("colmap_cameras", _COLMAP, "colmap", "COLMAP's cameras.txt and cameras.bin"),
    Entry("nerfstudio_json", {"nerfstudio": "transforms.json, with poses"},
          "nerfstudio", "nerfstudio's transforms.json"),
    Entry("gyroflow_json", {"gyroflow": "lens_profile.json"}),
    Entry("nvidia_json", {"nvidia": "rig.json; f-theta"}),
    Entry("mrcal_model", {"mrcal": ".cameramodel; holds any lens"},
          "mrcal", "mrcal's .cameramodel"),
)  # fmt: skip

WRITABLE = {name: what for entry in ENTRIES for name, what in entry.written.items()}
"""Format that is written -> what comes of it."""

READABLE = {entry.read: entry.reads for entry in ENTRIES if entry.read is not None}
"""Format that is read -> what is read."""
