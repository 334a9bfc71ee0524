"""Calibration itself: targets, observations, lenses, fit, assessment, views and files.

`target.py` (with `boards/`) and `observations.py` say what was seen, `lenses/` what it is seen
through, `fit/` makes the camera of it, `assess/` says what that is worth, `views/` what to do with
it, and `io/` keeps it in files. Photos, sentences, options and what may be wrong with a set-up are
of `app`.
"""
