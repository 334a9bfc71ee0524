"""Boards on paper: true-scale PDF pages, targets made for a paper size, and how to join them.

`extensions/printing/objects.py` makes a target for a size of paper: rectangular sheets whose shared
edges give every board its place in the world, each cut out of a page. `layout.py` places a single
board on its page. `drawing.py` takes the dark cells from the renderer's own `Face`
(`scene/faces.py`), so that prints and rendered photos agree, fills them as one path on axes
in millimetres, and adds ruler, words and cuts outside the quiet zone.
"""
