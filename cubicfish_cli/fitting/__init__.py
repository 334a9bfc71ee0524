"""2D-3D pairs -> camera and poses."""
