"""Places from which a camera sees boards well, and where it then sees their corners.

`views.py` samples poses from which a camera sees whole boards well, for `simulate` and `advise`;
`truth.py` has the exact pixels of corners from a pose, and which of them are visible.
"""
