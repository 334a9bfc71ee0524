"""Films: reading their frames, and choosing those that a camera can be made from."""
