"""Which photos are meant, reading them, and who works on many of them at a time."""
