"""Corners of one photo, or what the cache knows of it, and of many photos, found and named."""
