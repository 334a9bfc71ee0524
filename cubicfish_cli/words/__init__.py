"""Codes and figures of findings, and the one home of their sentences.

`catalogue.toml` has the sentences, by code and case, and `catalogue.py` reads them and those of
extensions. `camera.py` describes a camera and its verdict in words, and `phrases.py` has plurals,
lists and lengths.
"""
