"""Camera -> views, maps and undistorted pictures.

What is asked of a view is checked once, in `ViewOptions` (`options.py`), before a camera is known,
for commands, the library and `build_view` alike; `choose.py` makes the `View` of it for a camera,
at the scale that suits. A `View` says which ray each pixel looks along, from the camera's place
(`view.py`, with a `Projection` for each kind) or onto a plane (`plane.py`). `maps.py` asks
the camera for the pixel of each ray, in blocks of rows on two threads. For the cubic camera
`cubic_grid.py` does that by a few products of small matrices a picture, one way for each kind of
view: `tests/core/views/test_projections.py` holds each to the plain way. `camera_for_photos` makes
the camera of a rescaled photo, so that nothing else knows of them. `images.py` turns one photo
into pictures of the same nature, `batch.py` has `Views`, which renders each photo, and the loop
that writes many photos or shots, of which one that fails does not stop the others, and `video.py`
does frames in the codec's own planes, so that nothing is converted. `map_formats.py` writes for
other programs. `commands/pictures.py` plans which files are written, of photos, of their planes
(`PlaneViews`) and of the shots of a rig (`extensions/rigs/shots.py`).
"""
