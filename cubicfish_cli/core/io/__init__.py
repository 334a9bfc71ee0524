"""Corners that other detectors found and wrote in files of their own."""
