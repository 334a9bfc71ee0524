"""What the extension adds."""

from pathlib import Path

from cubicfish_cli.extension_table import Extension

EXTENSION = Extension(
    commands={"rig": "cubicfish_cli.extensions.rigs.group:command"},
    words=Path(__file__).with_name("words.toml"),
)
