"""What the extension adds."""

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(
    commands={"rig": "cubicfish_cli.extensions.rigs.group:command"},
    words="cubicfish_cli.extensions.rigs.words:WORDS",
)
