"""Calibration itself: targets, observations, lenses, fit, assessment, views and files.

`target.py` (with `boards/`) and `observations.py` say what was seen, and `lenses/` through what.
`fit/` makes the camera from it, `assess/` judges the camera, `views/` renders what it sees, and
`io/` keeps it in files. Photos, sentences, options and what may be wrong with a set-up belong to
`app`.
"""
