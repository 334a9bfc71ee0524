"""Simulated photos of a target through a lens, with known truth.

`simulate.py` renders photos from poses of `viewpoints/views.py` that fill the field, with rays
that are computed once for all photos (`RayGrid`), and turns light into grey levels, burnt out and
bleeding where there is too much of it. A `Face` (`render/board_faces.py`) is the print of a board.

Tests have more in tests/support. `AsymmetricLens` is of the family of the prior on P, and flatters
fits that rely on it: the lenses of `synthetic_lenses.py` are of no family. `simulated.py` makes
corners through any lens without pictures, with errors like those of photos, and
`synthetic_films.py` renders films of a hand that moves a target.
"""
