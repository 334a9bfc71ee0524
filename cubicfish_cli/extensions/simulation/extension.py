"""The extension's entry."""

from cubicfish_cli.app.extensions import Extension

EXTENSION = Extension(commands={"simulate": "cubicfish_cli.extensions.simulation.command:command"})
