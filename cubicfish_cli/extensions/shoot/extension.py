"""The extension's entry."""

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(
    commands={"shoot": "cubicfish_cli.extensions.shoot.command:command"}, needs=("advice",)
)
