"""The extension's entry."""

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(commands={"simulate": "cubicfish_cli.extensions.simulation.command:command"})
