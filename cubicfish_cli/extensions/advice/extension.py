"""The extension's entry."""

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(commands={"advise": "cubicfish_cli.extensions.advice.command:command"})
