"""Calibration itself: targets, observations, lenses, fit, assessment, views and files."""
