"""Films: reading their frames, and choosing those that a camera can be made from.

`extensions/films/source.py` opens a film. `decoding.py` decodes, for undistortion too: it gives
frames times that grow, and says which are damaged. `scan.py` measures every frame (`measure.py`)
and keeps the best of every few as the picture that it would become (`frame_files.py`);
`candidates.py` tells which are worth a look. `extensions/films/command.py` is the recipe, for
`frames`, `calibrate FILM` and `--best`; `frame_search.py` looks round by round, at a glance
(`corners/detection/finder.py`), and as `detect` does where that shows too little. `choose.py`
takes the pictures that add most and knows of corners only; what they add is told by
`app/sufficiency/worth.py`, which fits a first lens to all, or by its own coverage. `written.py`
writes them.
"""

# So many frames, or photos, are chosen at the most unless another number is asked for.
MOST = 60
