"""Photos of whole folders, straightened: read, remapped, written, many at once.

What is asked of a view is checked once, in `ViewOptions` (`options.py`), before a camera is known,
for commands, the library and `build_view` alike; `choose.py` makes the view of it for a camera, at
the scale that suits. `images.py` turns one photo into pictures of the same nature, `batch.py` has
`Views`, which renders each photo, and the loop that writes many photos or shots, of which one that
fails does not stop the others, and `video.py` does frames in the codec's own planes, so that
nothing is converted. `map_formats.py` writes maps, for other programs too. `commands/pictures.py`
plans which files are written, of photos, of their planes (`commands/planes.py`) and of the shots of
a rig (`extensions/rigs/shots.py`); `commands/view_options.py` makes options of what may be asked.
"""
