"""Photos of whole folders, straightened: read, remapped, written, many at once."""
