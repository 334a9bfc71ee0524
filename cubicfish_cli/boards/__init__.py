"""Boards: one class a type, each with its keys in target.yaml, its corners and its print."""
