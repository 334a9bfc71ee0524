"""The commands, a module each: options, function, result, and what is printed of it."""
