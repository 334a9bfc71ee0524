"""The two files at which parts meet, camera.yaml and corners.csv.

`camera_keys.py` reads the camera alone, which is all that rendering needs; `camera_yaml.py` has
`Calibrated`, which both a fit and its file are; `corners_csv.py` has corners, which other
detectors may write too.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
