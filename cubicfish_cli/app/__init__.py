"""What the commands share: photos, words, diagnosis, the terminal, extensions."""
