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

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import CubicfishError, Run
from cubicfish_cli.core_table import CALIBRATION_FILES
from cubicfish_cli.extension_guard import Place, extensions
from cubicfish_cli.extension_table import Output

if TYPE_CHECKING:
    from cubicfish import Observations
    from cubicfish.files import Content, Fingerprint
    from cubicfish.photos import Photo
    from cubicfish_cli.inputs.target_source import TargetSource
    from cubicfish_cli.observe import Inputs


def camera_files(
    folder: Path, name: str = "", kinds: Iterable[str] = CALIBRATION_FILES
) -> dict[str, Path]:
    """Where what there is of a camera goes, by kind, in the folder of a calibration."""
    return {kind: folder / name / CALIBRATION_FILES[kind] for kind in kinds}


def extension_outputs() -> dict[str, tuple[Place, Output]]:
    """What extensions make of a calibration: kind -> what makes it, and its file."""
    return {
        kind: (Place(name, made.content), made)
        for name, one in extensions().items()
        for kind, made in one.outputs.items()
    }


def photos_of(
    inputs: Sequence[Path], folder: Path, target: TargetSource, most: int | None, run: Run
) -> tuple[list[Path], list[Photo], str | None]:
    """Put photos in the place of inputs that extensions make photos of, such as films.

    Args:
        inputs: photos, tables and others.
        folder: where those photos go.
        target: what they show.
        most: how many may be made at most; None for the usual number.
        run: how the work is done.

    Returns:
        All photos; those that were made; and why there are no more, in a sentence, or None.

    Raises:
        CubicfishError: an input cannot be used.

    """
    photos, chosen = list(inputs), None
    made: list[Photo] = []
    for name, kind in [(name, kind) for name, one in extensions().items() for kind in one.inputs]:
        others = Place(name, kind.among).attempt(photos)
        if others:
            new, chosen = Place(name, kind.photos).load()(others, folder, target, most, run)
            made += new
            photos = [*(path for path in photos if path not in others), *(one.path for one in new)]
    return photos, made, chosen


def origin(
    observed: Sequence[Inputs],
    options: Mapping[str, Any],
    run: Run,
    target: Fingerprint | None = None,
) -> dict[str, Any]:
    """Where a calibration comes from, as ``made_by`` of its files says.

    Args:
        observed: what each camera was fitted to.
        options: of the fit.
        run: how the work was done.
        target: the calibration target's file, where it was none of the inputs.

    """
    files = [file for own in observed for file in own.files]
    return run.made_by(options, target or observed[0].target_file, files)


def corners_content(corners: Observations) -> Content:
    """What writes ``corners.csv``."""
    from cubicfish import save_corners

    return partial(save_corners, corners=corners, overwrite=True)


def page(maker: Place, *given: object, run: Run) -> Content | None:
    """A page about a calibration; None where it cannot be made.

    A camera that was hard to get is not lost because of that: the user is told.
    """
    run.listener.progress("Making the report")
    try:
        content: Content | None = maker.attempt(*given)
    except CubicfishError as problem:
        maker.warn_of(problem)
        return None
    return content
