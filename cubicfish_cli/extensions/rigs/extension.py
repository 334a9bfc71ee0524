"""What the extension adds."""

from cubicfish_cli.extension import Extension

EXTENSION = Extension(commands={"rig": "cubicfish_cli.extensions.rigs.group:command"})
