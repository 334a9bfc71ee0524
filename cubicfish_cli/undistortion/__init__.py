"""Undistortion of whole folders of photos: read, remapped and written, many at once.

What a view shows and how a picture is straightened is the library's (`cubicfish/views`);
`remarks.py` says what a view leaves out. `images.py` makes files of the nature of their photos'.
`batch.py` has `Views`, which renders each photo, and the loop that writes many photos or shots; one
that fails does not stop the others. `video.py` renders frames in the codec's own planes, so that
nothing is converted. `map_formats.py` writes maps, for other programs too; `options.py` has the
options of a board's plane. `commands/pictures.py` plans which files are written, of photos, of
their planes (`commands/planes.py`) and of the shots of a rig (`extensions/rigs/shots.py`);
`commands/view_options.py` makes the command line's options of a view.
"""
