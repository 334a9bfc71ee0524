"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.io.camera_keys import read_camera as read_camera
from cubicfish.io.camera_yaml import PointCameraFile as PointCameraFile
from cubicfish.io.corners_csv import load_correspondences as load_correspondences
