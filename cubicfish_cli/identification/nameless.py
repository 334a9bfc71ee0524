"""Photos -> the grids in them, where nobody says which object they show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from cubicfish_cli.detection.finder import find_grids
from cubicfish_cli.detection.grid_cache import GridCache
from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.errors import PhotoError
from cubicfish_cli.executors.pool import map_photos, settled, workers_for
from cubicfish_cli.photos import Photo, decode_picture, grey, read_file


def nameless_grids(
    photos: Sequence[Photo],
    *,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    cache: GridCache | None = None,
) -> list[FoundGrids | None]:
    """Find the checkerboards in photos on disk.

    Args:
        photos: where the photos are.
        jobs: processes to use; None for one a processor.
        progress: called with photos done and all photos.
        cache: what was found in photos that were searched before; None searches them all.

    Returns:
        What was found in each; None for photos that cannot be read.

    """
    found: list[FoundGrids | None] = []
    look = partial(_find, cache=cache)
    for one in map_photos(look, photos, workers_for(jobs, len(photos))):
        found.append(one)
        if progress is not None:
            progress(len(found), len(photos))
    return found


def _find(photo: Photo, *, cache: GridCache | None) -> FoundGrids | None:
    try:
        data = read_file(photo.path)
        key = cache.key(data) if cache else ""
        known = cache.load(key) if cache else None
        if known is not None:
            return known
        found = find_grids(grey(decode_picture(photo.path, data)))
    except PhotoError:
        return None
    grids = tuple(replace(grid, pixel=settled(grid.pixel)) for grid in found.grids)
    found = replace(found, grids=grids)
    if cache:
        cache.save(key, found)
    return found
