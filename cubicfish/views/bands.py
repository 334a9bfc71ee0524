"""A map that is made and written some rows at a time, and the map back from a view to a photo."""

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Self
from zipfile import ZipFile

import numpy as np

from cubicfish.errors import ViewError
from cubicfish.files.whole_files import StrPath, whole_file
from cubicfish.models.cubic import CubicCamera
from cubicfish.types import BoolArray
from cubicfish.views.fields import in_picture
from cubicfish.views.maps import OUTSIDE, UndistortMap, build_map
from cubicfish.views.view import MAX_SIDE, PointProjector, View

_ROWS_PER_BLOCK = 32
# What becomes of a map on its way into a file takes 40 bytes for each of so many pixels.
_BAND_PIXELS = 1_000_000


@dataclass(frozen=True, kw_only=True)
class MapInBands:
    """A map that is made some rows at a time, each time that it is gone through.

    Attributes:
        view: what is rendered, or what it is rendered from again.
        size: (width, height) of the map.
        make: the map of some rows.

    """

    view: View
    size: tuple[int, int]
    make: Callable[[range], UndistortMap]

    @classmethod
    def of_camera(cls, camera: PointProjector, view: View) -> Self:
        """The map that renders a view from a camera's photos."""
        return cls(view=view, size=view.size, make=partial(build_map, camera, view))

    @classmethod
    def back(cls, camera: CubicCamera, view: View) -> Self:
        """The map that renders a camera's photo again from a picture of a view."""
        return cls(
            view=view, size=camera.image_size, make=partial(build_redistort_map, camera, view)
        )

    @classmethod
    def of(cls, made: UndistortMap) -> Self:
        """A map that is there, in bands."""

        def cut(rows: range) -> UndistortMap:
            own = slice(rows.start, rows.stop)
            x, y, valid = made.map_x[own], made.map_y[own], made.valid[own]
            return replace(made, map_x=x, map_y=y, valid=valid)

        height, width = made.map_x.shape
        return cls(view=made.view, size=(width, height), make=cut)

    def __iter__(self) -> Iterator[tuple[slice, UndistortMap]]:
        """Yield rows and their map, from the top on."""
        width, height = self.size
        step = max(1, _BAND_PIXELS // width)
        for top in range(0, height, step):
            rows = range(top, min(height, top + step))
            yield slice(rows.start, rows.stop), self.make(rows)

    @property
    def valid(self) -> BoolArray:
        """(H, W) whether the photo has the pixel and the camera may be trusted there."""
        return np.concatenate([band.valid for _, band in self])

    def write(self, path: Path) -> None:
        """Write it as :func:`save_map` does, over an existing file too.

        It is as ``numpy.savez`` writes it, but that ``map_x`` is never in memory.

        Raises:
            OSError: the file cannot be written.

        """
        width, height = self.size
        y, valid = np.empty((height, width), np.float32), np.empty((height, width), bool)
        head = {"descr": y.dtype.str, "fortran_order": False, "shape": y.shape}
        with ZipFile(path, "w") as file:

            def member(name: str) -> AbstractContextManager[IO[bytes]]:
                return file.open(f"{name}.npy", "w", force_zip64=True)

            with member("map_x") as part:
                np.lib.format.write_array_header_1_0(part, head)
                for rows, band in self:
                    part.write(band.map_x.tobytes())
                    y[rows], valid[rows] = band.map_y, band.valid
            way = "redistort_map" if band.redistorts else "undistort_map"
            more = {
                "map_y": y,
                "valid": valid,
                "view": np.array(json.dumps(self.view.as_record())),
                "format": np.array(f"cubicfish {way} 1"),
                "image_size": np.array(band.image_size),
            }
            for name, values in more.items():
                with member(name) as part:
                    np.lib.format.write_array(part, values, allow_pickle=False)


def build_redistort_map(camera: CubicCamera, view: View, rows: range | None = None) -> UndistortMap:
    """The map that renders the camera's photo again from a picture of the view.

    Args:
        camera: whose photo it is.
        view: what the picture shows.
        rows: the rows of the photo that the map is of; all by default.

    Raises:
        ViewError: the camera's photos are larger than ``cv2.remap`` can take.

    """
    width, height = camera.image_size
    if max(width, height) > MAX_SIDE:
        raise ViewError(f"a side of a photo may have {MAX_SIDE} pixels at most")
    rows = rows or range(height)
    x, y = np.full((2, len(rows), width), OUTSIDE, np.float32)
    valid = np.zeros((len(rows), width), bool)
    for top in range(0, len(rows), _ROWS_PER_BLOCK):
        own = slice(top, min(len(rows), top + _ROWS_PER_BLOCK))
        pixel = np.stack(np.meshgrid(np.arange(width), rows[own]), axis=-1).astype(float)
        source = view.pixels(camera.unproject(pixel))
        inside = in_picture(source, view.size)
        valid[own] = inside
        x[own][inside], y[own][inside] = source[inside].T
    return UndistortMap(
        map_x=x, map_y=y, valid=valid, view=view, image_size=view.size, redistorts=True
    )


def save_map(
    path: StrPath, undistort_map: UndistortMap | MapInBands, *, overwrite: bool = False
) -> None:
    """Write a map for ``cv2.remap``, as a file that ``numpy.load`` reads.

    It has ``map_x`` and ``map_y`` (H, W) float32, pixels of the photo, −1 where it has none;
    ``valid`` (H, W) bool; ``view`` (JSON text), ``format`` and ``image_size``.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    made = undistort_map
    in_bands = MapInBands.of(made) if isinstance(made, UndistortMap) else made
    with whole_file(Path(path), overwrite=overwrite) as temporary:
        in_bands.write(temporary)
