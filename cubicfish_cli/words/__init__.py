"""Sentences of findings and events, which the library knows by code and figures alone.

`sentences.py` renders them by the functions of `set_up.py`, `fit.py`, `photos.py` and `events.py`,
each by code and case in a table (`table.py`), and by those of extensions. `remarks.py` says once
what many photos share, `target.py` what to know about a target before any photo, `camera.py` a
camera and its verdict, and `phrases.py` has plurals, shares and lengths.
"""
