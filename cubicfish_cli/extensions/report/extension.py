"""The extension's entry."""

from cubicfish_cli.extension_table import Extension, Output
from cubicfish_cli.render.drawing import REPORT

EXTENSION = Extension(
    commands={"report": "cubicfish_cli.extensions.report.command:command"},
    outputs={
        "report": Output(
            file="report.html",
            content="cubicfish_cli.extensions.report.page:page_of_fit",
            needs=REPORT,
        )
    },
    needs=("advice", "native"),
)
