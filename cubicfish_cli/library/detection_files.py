"""Photos in files -> corners.csv, and pictures of what was found in each photo."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from cubicfish_cli.corner_files.observations_csv import save_corners
from cubicfish_cli.errors import OutputError
from cubicfish_cli.files import refuse_existing
from cubicfish_cli.identification.identified import Detection
from cubicfish_cli.library.asked import RUN, Run, StrPath, TargetSource, paths_of
from cubicfish_cli.library.detection import find_corners
from cubicfish_cli.library.inputs import named_photos
from cubicfish_cli.overlay.draw import draw_found
from cubicfish_cli.photos import Photo, read_grey
from cubicfish_cli.target import Target
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


@dataclass(frozen=True, kw_only=True, eq=False)
class DetectedFiles:
    """What became of :func:`detect_files`.

    Attributes:
        detection: the corners, and what became of each photo.
        file: the table of corners.
        drawings: pictures of what was found; None where none were asked for.

    """

    detection: Detection
    file: Path
    drawings: list[Path] | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish detect --json`` prints."""
        keys = ("boards", "corners", "added", "exact", "problem", "notes")
        corners = self.detection.corners
        return {
            "file": self.file,
            "image_size": corners.image_size,
            "images": len(corners.images),
            "corners": len(corners.pixel),
            "findings": [finding.as_record() for finding in self.detection.findings],
            "per_image": [
                {
                    "image": photo.name,
                    **{key: getattr(photo, key) for key in keys},
                    "findings": [finding.as_record() for finding in photo.findings],
                }
                for photo in self.detection.photos
            ],
            **({} if self.drawings is None else {"drawings": self.drawings}),
        }


def detect_files(
    photos: StrPath | Sequence[StrPath],
    target: TargetSource | Target | StrPath,
    table: StrPath = "corners.csv",
    *,
    draw: StrPath | None = None,
    run: Run = RUN,
) -> DetectedFiles:
    """Find the corners of a target in photos and write them, as ``cubicfish detect`` does.

    Args:
        photos: files, folders and globs.
        target: the object, or its file.
        table: where the corners go.
        draw: a folder for a picture of what was found in each photo that could be read.
        run: how the work is done.

    Raises:
        UsageError: no target is named.
        CubicfishError: a photo or the target cannot be used, no corner could be named, or a file
            exists and may not be replaced.

    """
    source, file = TargetSource.of(target), Path(table)
    source.check()
    refuse_existing(file, overwrite=run.overwrite)
    found = named_photos(paths_of(photos), run.listener)
    pictures = {} if draw is None else drawings(Path(draw), found)
    refuse_existing(*pictures.values(), overwrite=run.overwrite)
    detection = find_corners(found, source.load(run.listener), run)
    save_corners(file, detection.corners, overwrite=run.overwrite)
    if draw is None:
        return DetectedFiles(detection=detection, file=file)
    written, progress = [], run.listener.counting("Drawing")
    for done, (photo, report) in enumerate(zip(found, detection.photos, strict=True)):
        progress(done, len(found))
        if report.found is not None:
            drawn = draw_found(read_grey(photo.path), report, detection.corners)
            write_picture(pictures[photo.name], drawn, overwrite=run.overwrite)
            written.append(pictures[photo.name])
    return DetectedFiles(detection=detection, file=file, drawings=written)
