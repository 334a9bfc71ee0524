"""Executors: processes of this machine, or of others."""
