"""Codes and figures of findings, and the one home of their sentences.

`catalogue.toml` has the sentences, by code and case, and `catalogue.py` reads them and those of
extensions. `camera.py` says a camera and what it is worth in words, and `phrases.py` has plurals,
lists and lengths.
"""
