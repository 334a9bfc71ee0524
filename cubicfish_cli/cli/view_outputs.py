"""What goes along with a result: its mask, and its virtual camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cubicfish_cli.cli.mask_limit import Trusted
    from cubicfish_cli.undistortion.map_formats import PixelMap
    from cubicfish_cli.undistortion.maps import UndistortMap

Write = Callable[[Path], object]


def part_name(path: Path, part: str) -> Path:
    """``flat.png`` and ``front`` -> ``flat_front.png``; as it is for a view of one part."""
    return path.with_name(f"{path.stem}_{part}{path.suffix}") if part else path


def view_writers(
    maps: Mapping[str, UndistortMap] | Mapping[str, PixelMap],
    *,
    mask: Path | None,
    beside: Path | None,
    trusted: Trusted | None = None,
) -> dict[Path, Write]:
    """Path -> what writes it, for the mask and the virtual camera of each part of a view.

    The mask is what ``trusted`` makes of a map; without it, where the map is valid.
    """
    from cubicfish_cli.undistortion.images import check_suffix, encode_picture
    from cubicfish_cli.undistortion.view_files import (
        mask_picture,
        view_file_names,
        view_text,
        write_opencv_view,
    )

    writers: dict[Path, Write] = {}
    for part, made in maps.items():
        if mask is not None:
            check_suffix(mask)
            content = encode_picture(mask, mask_picture(trusted(made) if trusted else made.valid))
            writers[part_name(mask, part)] = partial(_write_bytes, content)
        if beside is not None:
            plain, opencv = view_file_names(part_name(beside, part))
            writers[plain] = partial(_write_bytes, view_text(made.view).encode())
            writers[opencv] = partial(write_opencv_view, view=made.view)
    return writers


def write_all(writers: Mapping[Path, Write], *, overwrite: bool) -> list[Path]:
    """Write every file, or none.

    Raises:
        OutputError: one exists and ``overwrite`` is false, or cannot be written.

    """
    from cubicfish_cli.files import whole_files

    if not writers:
        return []
    with whole_files(list(writers), overwrite=overwrite) as temporaries:
        for temporary, write in zip(temporaries, writers.values(), strict=True):
            write(temporary)
    return list(writers)


def write_view_outputs(
    maps: Mapping[str, UndistortMap] | Mapping[str, PixelMap],
    *,
    mask: Path | None,
    beside: Path | None,
    overwrite: bool,
    skip_existing: bool = False,
    trusted: Trusted | None = None,
) -> list[Path]:
    """Write the mask and the virtual camera, those that are asked for; return the files."""
    from cubicfish_cli.files import refuse_existing

    writers = view_writers(maps, mask=mask, beside=beside, trusted=trusted)
    if skip_existing:
        writers = {path: write for path, write in writers.items() if not path.is_file()}
    for path in writers:
        refuse_existing(path, overwrite=overwrite, can_skip=not skip_existing)
    return write_all(writers, overwrite=overwrite)


def _write_bytes(content: bytes, path: Path) -> None:
    path.write_bytes(content)
