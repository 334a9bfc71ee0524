"""The extension's entry."""

from cubicfish_cli.app.drawing import REPORT
from cubicfish_cli.app.extensions import Extension, Output

EXTENSION = Extension(
    commands={"report": "cubicfish_cli.extensions.report.command:command"},
    outputs={
        "report": Output(
            file="report.html",
            content="cubicfish_cli.extensions.report.page:page_of_fit",
            needs=REPORT,
        )
    },
)
