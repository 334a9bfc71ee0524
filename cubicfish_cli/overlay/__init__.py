"""What was found, drawn over a photo."""
