"""The extension's entry."""

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(
    commands={"target print": "cubicfish_cli.extensions.printing.command:command"}
)
