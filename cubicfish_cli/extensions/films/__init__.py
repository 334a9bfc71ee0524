"""Frames of films that are worth calibrating from.

`candidates.py` tells which of those that a scan kept (`app/films/scan.py`) are worth a look;
`extensions/films/command.py` is the recipe, for `frames` and `calibrate FILM`; `written.py` writes
them.
"""
