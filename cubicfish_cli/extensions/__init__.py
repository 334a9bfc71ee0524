"""Extensions, one folder each, with its commands, words and files."""
