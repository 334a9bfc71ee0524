"""Codes and figures of findings, and the one home of their sentences."""
