"""Boards on paper: true-scale PDF pages, targets made for a paper size, and how to join them.

`extensions/printing/objects.py` makes a target for a size of paper: rectangular sheets whose shared
edges give every board its place in the world, each cut out of a page. `layout.py` finds where a
board that stands alone lies on its page. `drawing.py` asks the renderer's own `Face`
(`app/board_faces.py`) which cells are dark, so that what is printed is what is rendered, fills them
as one path on axes in millimetres, and adds ruler, words and cuts outside the quiet zone.
"""
