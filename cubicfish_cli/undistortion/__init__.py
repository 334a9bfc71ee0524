"""Camera -> views, maps and undistorted pictures."""
