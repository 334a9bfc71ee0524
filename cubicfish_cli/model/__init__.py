"""The cameras: the cubic polynomial camera and its radial reference."""
