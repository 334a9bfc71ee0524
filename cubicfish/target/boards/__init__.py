"""Boards: one class per type, each with its keys in target.yaml, its corners and its markers."""
