"""The extension's entry. A format is a module beside this one, and a table in formats.toml."""

from pathlib import Path

from cubicfish_cli.extension_table import Extension

_HERE = "cubicfish_cli.extensions.formats"

EXTENSION = Extension(
    commands={
        "corners": f"{_HERE}.corners:command",
        "import": f"{_HERE}.import_camera:command",
    },
    formats=Path(__file__).with_name("formats.toml"),
)
"""Files that hold a camera."""
