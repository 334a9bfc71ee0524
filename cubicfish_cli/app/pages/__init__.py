"""HTML pages: what those about a camera and about a rig have in common."""

PAGE = "report.html"
