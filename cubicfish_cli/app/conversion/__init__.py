"""Cubic cameras from and to the lens models of other tools."""
