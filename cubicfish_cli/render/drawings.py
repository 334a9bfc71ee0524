"""Where drawings of photos go: their files."""

import os
from collections.abc import Sequence
from pathlib import Path, PurePath

from cubicfish import OutputError
from cubicfish.photos import Photo


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
