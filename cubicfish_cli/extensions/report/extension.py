"""What the extension adds."""

from cubicfish_cli.app.extensions import Extension

EXTENSION = Extension(commands={"report": "cubicfish_cli.extensions.report.command:command"})
