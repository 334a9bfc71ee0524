"""Simulated photos of a target through a lens, with known truth.

The command writes what a `Scene` of the library shows: photos, their corners and poses.

Tests have more in tests/support. `AsymmetricLens` is of the family of the prior on P, and flatters
fits that rely on it: the lenses of `synthetic_lenses.py` are of no family. `simulated.py` makes
corners through any lens without pictures, with errors like those of photos, and
`synthetic_films.py` renders films of a hand that moves a target.
"""
