"""What the extension adds."""

from cubicfish_cli.app.extensions import Extension

EXTENSION = Extension(
    commands={
        "corners": "cubicfish_cli.extensions.formats.corners:command",
        "export": "cubicfish_cli.extensions.formats.export:command",
        "import": "cubicfish_cli.extensions.formats.import_camera:command",
    }
)
