"""The extension's entry."""

from cubicfish_cli.app.extensions import Extension, Input

EXTENSION = Extension(
    commands={"frames": "cubicfish_cli.extensions.films.command:command"},
    inputs=(
        Input(
            among="cubicfish_cli.app.inputs:films_among",
            photos="cubicfish_cli.extensions.films.command:frames_of",
        ),
    ),
)
