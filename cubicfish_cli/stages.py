"""The stages of a calibration, of one camera or of several on one body.

There are five, each with one result, which the next one takes:

plan      what is read and what may be written; all that can be refused is, before the work
observe   photos, films or tables -> ``Inputs`` of each camera (`observe.py`)
fit       observations -> cameras: the library's
contents  what each file holds, extensions' files too
write     all files or none, without those of an earlier calibration

A camera's own files are in a folder of its name; one camera alone has none, and they are in the
calibration's folder itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from cubicfish import Event, Listener, Run
from cubicfish.run import made_by_record
from cubicfish_cli.extension_table import Output, extensions

if TYPE_CHECKING:
    from cubicfish import Observations
    from cubicfish.files import Content
    from cubicfish.files.fingerprint import FileRecord
    from cubicfish_cli.inputs.target_source import TargetSource
    from cubicfish_cli.observe import Inputs


_FILES = {
    "camera": "camera.yaml",
    "map": "undistort_map.npz",
    "target": "target.refined.yaml",
    "corners": "corners.csv",
    "drawn": "target.yaml",
}
KINDS = tuple(_FILES)
"""What a calibration writes, in words; the camera is removed first and written last."""


def camera_files(folder: Path, name: str = "", kinds: Sequence[str] = KINDS) -> dict[str, Path]:
    """Where what there is of a camera goes, by kind, in the folder of a calibration."""
    return {kind: folder / name / _FILES[kind] for kind in kinds}


def extension_outputs() -> dict[str, Output]:
    """What extensions make of a calibration, by kind."""
    return {kind: made for one in extensions() for kind, made in one.outputs.items()}


def photos_of(
    inputs: Sequence[Path], folder: Path, target: TargetSource, most: int | None, run: Run
) -> tuple[list[Path], str | None]:
    """Put photos in the place of inputs that extensions make photos of, such as films.

    Args:
        inputs: photos, tables and others.
        folder: where those photos go.
        target: what they show.
        most: how many may be made at most; None for the usual number.
        run: how the work is done.

    Returns:
        The photos, and why there are no more, in a sentence; None where none were made.

    Raises:
        CubicfishError: an input cannot be used.

    """
    photos, chosen = list(inputs), None
    for kind in (kind for one in extensions() for kind in one.inputs):
        others = resolve_name(kind.among)(photos)
        if others:
            made, chosen = resolve_name(kind.photos)(others, folder, target, most, run)
            photos = [*(path for path in photos if path not in others), *made]
    return photos, chosen


def origin(
    observed: Sequence[Inputs],
    options: Mapping[str, Any],
    run: Run,
    target: FileRecord | None = None,
) -> dict[str, Any]:
    """Where a calibration comes from, as ``made_by`` of its files says.

    Args:
        observed: what each camera was fitted to.
        options: of the fit.
        run: how the work was done.
        target: the calibration target's file, where it was none of the inputs.

    """
    files = [file for own in observed for file in own.files]
    return made_by_record(run.command, options, target or observed[0].target_file, files)


def camera_contents(text: str, corners: Observations | None) -> dict[str, Content]:
    """What a camera's own files hold, by kind; no corners where they need not be written."""
    from cubicfish.io.corners_csv import corners_text

    return {"camera": text, **({} if corners is None else {"corners": corners_text(corners)})}


def page(make: Callable[[], Content], listener: Listener) -> Content | None:
    """A page about a calibration; None where it cannot be made.

    A camera that was hard to get is not lost because of that: the listener is told.
    """
    listener.progress("Making the report")
    try:
        return make()
    except Exception as problem:  # libraries may be broken in ways of their own
        what = f"{type(problem).__name__}: {problem}".splitlines()[0]
        listener.tell(Event.NO_PAGE, problem=what)
        return None
