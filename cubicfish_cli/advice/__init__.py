"""What to photograph next: where the camera is uncertain, and which photos would help most."""
