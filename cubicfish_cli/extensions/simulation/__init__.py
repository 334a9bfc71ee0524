"""Target and lens -> photos with known truth.

`simulate.py` takes the poses of `app/viewpoints/views.py` that fill the field and renders them,
with rays that are worked out once for all photos (`RayGrid`), and makes grey levels of light, burnt
out and bleeding where there is too much. What is printed on a board is a `Face`
(`app/board_faces.py`).

Tests have more in tests/support. `AsymmetricLens` is of the family that P is held to, and flatters
what leans on that: the lenses of `synthetic_lenses.py` are of none. `simulated.py` makes corners
through any lens without pictures, with errors as those of photos, and `synthetic_films.py` renders
films of a hand that moves a target.
"""
