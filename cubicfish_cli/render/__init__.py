"""What is drawn: boards and targets, corners over photos, differences, and HTML pages."""
