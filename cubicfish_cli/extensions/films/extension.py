"""The extension's entry."""

from cubicfish_cli.extension_table import Extension, Input

EXTENSION = Extension(
    commands={"frames": "cubicfish_cli.extensions.films.command:command"},
    inputs=(
        Input(
            among="cubicfish_cli.observe:films_among",
            photos="cubicfish_cli.extensions.films.command:frames_of",
        ),
    ),
)
