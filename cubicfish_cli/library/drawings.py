"""What was found in photos, drawn over them, one picture per photo."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePath

from cubicfish_cli.errors import OutputError
from cubicfish_cli.identification.identified import Detection
from cubicfish_cli.overlay.draw import draw_found
from cubicfish_cli.photos import Photo, read_grey
from cubicfish_cli.undistortion.images import write_picture


def drawings(folder: Path, photos: Sequence[Photo]) -> dict[str, Path]:
    """Where the drawing of each photo goes, by the photo's name.

    The photo's suffix is left out, unless two drawings would then have one name or a drawing
    would replace a photo.

    Raises:
        OutputError: a drawing would replace a photo whatever it is called.

    """
    taken = {os.path.realpath(photo.path) for photo in photos}
    full = [photo.name for photo in photos]
    short = [PurePath(name).with_suffix("").as_posix() for name in full]
    for names in (short, full):
        paths = [folder / f"{name}.png" for name in names]
        # File systems may not tell a from A.
        apart = names is full or len({name.casefold() for name in names}) == len(names)
        if apart and taken.isdisjoint(map(os.path.realpath, paths)):
            return dict(zip(full, paths, strict=True))
    raise OutputError(f"drawings in {folder} would replace photos: choose another folder")


def write_drawings(
    photos: Sequence[Photo],
    detection: Detection,
    pictures: Mapping[str, Path],
    progress: Callable[[int, int], None],
    *,
    overwrite: bool,
) -> list[Path]:
    """Write a picture of what was found in each photo that could be read.

    Args:
        photos: the photos.
        detection: what was found in them.
        pictures: what :func:`drawings` gave.
        progress: called with photos done and all photos.
        overwrite: whether files may be replaced.

    Returns:
        The pictures.

    Raises:
        OutputError: one exists and ``overwrite`` is false, or cannot be written.

    """
    written = []
    for done, (photo, report) in enumerate(zip(photos, detection.photos, strict=True)):
        progress(done, len(photos))
        if report.found is not None:
            drawn = draw_found(read_grey(photo.path), report, detection.corners)
            write_picture(pictures[photo.name], drawn, overwrite=overwrite)
            written.append(pictures[photo.name])
    return written
