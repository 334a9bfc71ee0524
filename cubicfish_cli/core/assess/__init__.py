"""A fit's record -> what it is worth, how certain the camera is, and its key figures."""
