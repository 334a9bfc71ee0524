"""Frames of films that are worth calibrating from.

`extensions/films/frames.py` searches the frames that a scan kept (`films/scan.py`), and
chooses; `extensions/films/command.py` has the whole sequence, for `frames` and `calibrate FILM`;
`written.py` writes the frames.
"""
