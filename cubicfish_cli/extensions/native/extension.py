"""The extension's entry. A language is a template, and a table in formats.toml."""

from pathlib import Path

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(formats=Path(__file__).with_name("formats.toml"))
"""The camera itself, as source text."""
