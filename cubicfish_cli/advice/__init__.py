"""What to photograph next: where knowledge of a camera is thin, and what would help most."""
