"""The commands, one module each: its options, its function, its result, and what it prints."""
