"""HTML pages: what those about a camera and about a rig have in common.

`plot.py` draws plots as SVG; `figures.py` says what a page's figures look like, and `template.py`
fills them into HTML.
"""

PAGE = "report.html"
