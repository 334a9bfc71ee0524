"""Whether photos are enough for a camera, where they are lacking, and what one more adds."""
