"""From a photo to observations: corners, markers, and which corner of which board each one is."""
