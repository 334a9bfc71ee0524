"""The extension's entry."""

from cubicfish_cli.app.extensions import Extension

EXTENSION = Extension(
    commands={"frames": "cubicfish_cli.extensions.films.command:command"},
    inputs=("cubicfish_cli.extensions.films.command:with_frames",),
)
