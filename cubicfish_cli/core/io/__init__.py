"""The two files that parts meet at, camera.yaml and corners.csv.

`camera_yaml.py` has `Calibrated`, which both a fit and its file are; `observations_csv.py` has
corners.
"""
