"""The extension's entry."""

from cubicfish_cli.app.extensions import Extension

EXTENSION = Extension(commands={"advise": "cubicfish_cli.extensions.advice.command:command"})
