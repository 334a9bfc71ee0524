"""Films: reading their frames, and choosing those that a camera can be made from."""

# So many frames, or photos, are chosen at the most unless another number is asked for.
MOST = 60
