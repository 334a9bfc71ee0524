"""Files that hold a camera."""
