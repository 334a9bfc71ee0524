"""Films: reading their frames, and choosing pictures that a camera can be made from.

`app/films/source.py` opens a film and decodes it, for undistortion too: it gives frames times that
grow; `recordings.py` reads topics of bags as films. `scan.py` measures every frame (`measure.py`)
and keeps the best of every few as the picture that it would become. `frame_search.py` searches
pictures round by round, quickly, and as `detect` does where that shows too little; it chooses
photos, too (`--most`). `choose.py` takes the pictures that add most and knows of corners only; what
they add is told by `app/sufficiency/worth.py`, which fits a first lens to all, or by its own
coverage.
"""

# So many frames, or photos, are chosen at the most unless another number is asked for.
MOST = 60
