"""The page about a rig: what ``rig`` writes beside rig.yaml, and ``report`` again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli.terminal import working

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict


def write_page(rig: Path, page: Path, *, overwrite: bool) -> Verdict:
    """Write the page about a rig's file, and judge the rig.

    Raises:
        CameraFileError: the rig cannot be read.
        OutputError: the page is there, or cannot be written.

    """
    from cubicfish_cli.assess.rig_verdict import rig_verdict
    from cubicfish_cli.files import write_text
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rigs import loaded_record
    from cubicfish_cli.report.extra import quiet

    with quiet():
        from cubicfish_cli.report.rig_page import rig_html

    loaded = load_rig(rig)
    record = loaded_record(loaded)
    with working("Making the report"):
        text = rig_html(loaded, record)
    write_text(page, text, overwrite=overwrite)
    return rig_verdict(record)
