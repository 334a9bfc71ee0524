"""What to do after a calibration: a line to paste, or what would mend it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli.options import DEFAULT_MODEL, verbosity
from cubicfish_cli.cli.terminal import result

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict


def say_next(judged: Verdict, camera: Path, photo: Path | None, report: Path | None) -> None:
    """Say what is to be done next, unless ``--quiet``.

    Args:
        judged: what the camera is worth.
        camera: its file.
        photo: one of those that it was made from.
        report: the page about it, where there is one.

    """
    from cubicfish_cli.words.finding import asks_for_photos

    if verbosity() < 0:
        return
    result()
    if judged.level == "bad":
        result(f"Next: {judged.reasons[0].do}")
        if asks_for_photos(judged.reasons[:1]):
            result(f"      cubicfish advise{_folder(camera)}", whole=True)
    else:
        name = "PHOTO" if photo is None else shlex.quote(str(photo))
        flat = f"flat{photo.suffix.lower()}" if photo is not None else "flat.png"
        option = f" --model{_folder(camera)}" if camera != DEFAULT_MODEL else ""
        result(f"Next: cubicfish undistort {name} {flat}{option}", whole=True)
    if report is not None:
        result(f"      open {shlex.quote(str(report))}", whole=True)


def _folder(camera: Path) -> str:
    return "" if camera == DEFAULT_MODEL else f" {shlex.quote(str(camera.parent))}"
