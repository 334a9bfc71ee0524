"""Places from which a camera sees boards well, and where it then sees their corners."""
