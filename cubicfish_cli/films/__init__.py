"""Films: reading their frames, and choosing pictures to calibrate from.

`films/source.py` opens a film and decodes it, for undistortion too, and makes the frames' times
strictly growing; `recordings.py` reads topics of bags as films. `scan.py` measures every frame
(`measure.py`) and keeps the best of every few as the picture that it would become.
`frame_search.py` searches pictures for boards round by round, quickly, and in full where that finds
too little; it chooses photos, too (`--most`). `choose.py` takes the pictures that add most and
knows of corners only: `sufficiency/information_gain.py`, which fits a first lens to all, or its
own coverage says what they add.
"""

# So many frames, or photos, are chosen at the most unless another number is asked for.
MOST = 60
