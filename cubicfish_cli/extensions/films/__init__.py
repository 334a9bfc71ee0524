"""Frames of films that are worth calibrating from.

`extensions/films/frames.py` tells which of those that a scan kept (`app/films/scan.py`) are worth a
look, and chooses; `extensions/films/command.py` is the recipe, for `frames` and `calibrate FILM`;
`written.py` writes them.
"""
