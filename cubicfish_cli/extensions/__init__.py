"""What stands around the core: each a folder with its commands, words and files."""
