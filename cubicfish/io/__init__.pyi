"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.io.camera_keys import read_camera as read_camera
