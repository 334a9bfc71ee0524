"""View and camera -> the map that ``cv2.remap`` takes, and its file.

Nobody vouches for such a file. A small one can claim huge arrays: every size is read, and held
against the others, before there is room made for anything. Nothing in it can run (no pickles).

A camera for photos that are an exact rescale or a stated crop of the calibrated ones.

A pixel's centre is at its whole coordinates, so a photo scaled by s has pixel (x + 1/2)·s − 1/2
where the original has x. Leaving the half out shifts a half-size picture by a quarter pixel.
"""

from __future__ import annotations

import math
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError
from cubicfish_cli.files import whole_file
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.types import BoolArray
from cubicfish_cli.undistortion.choose import view_from_json
from cubicfish_cli.undistortion.cubic_grid import grid_of
from cubicfish_cli.undistortion.plane import PlaneView, PointProjector, seen_near
from cubicfish_cli.undistortion.projections import CrossView
from cubicfish_cli.undistortion.view import MAX_SIDE, View
from cubicfish_cli.wording import quoted

MAX_SMALL = 100_000
"""Bytes of an array whose shape is not known before."""
# Packed arrays may unpack to so much, whatever the file's own size, and so many times that size.
_ALWAYS, _TIMES = 200_000_000, 20
_MAX_DIRECTORY = 65_536
_MAX_HEADER = 1000
_BLOCK = 1 << 24
FORMAT = "cubicfish undistort_map 1"
REDISTORT_FORMAT = "cubicfish redistort_map 1"
OUTSIDE = -1.0
_KEYS = ("map_x", "map_y", "valid", "view", "format", "image_size")
# A block's arrays stay in the processor's cache; fewer pixels than these are not worth a thread.
_PIXELS_PER_BLOCK = 65_536
_PIXELS_FOR_THREADS = 250_000
_THREADS = 2


class Arrays:
    """The arrays of an open .npz file, by their names."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._archive.NameToInfo

    def kind(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """What an array claims to be: its shape and the type of its numbers.

        Raises:
            ViewError: it is not a plain array, or not as long as it claims.

        """
        with self._opened(name) as (_, shape, dtype):
            return shape, dtype

    def read(self, name: str, *, max_bytes: int = MAX_SMALL) -> npt.NDArray[Any]:
        """An array of at most ``max_bytes``.

        Raises:
            ViewError: as :meth:`kind`, or it is larger.

        """
        with self._opened(name) as (file, shape, dtype):
            length = math.prod(shape) * dtype.itemsize
            if length > max_bytes:
                raise ViewError(f"{name} is far too large")
            into = np.empty(length, np.uint8)
            for start in range(0, length, _BLOCK):
                block = file.read(min(_BLOCK, length - start))
                into[start : start + len(block)] = np.frombuffer(block, np.uint8)
        return into.view(dtype).reshape(shape) if length else np.empty(shape, dtype)

    @contextmanager
    def _opened(self, name: str) -> Iterator[tuple[IO[bytes], tuple[int, ...], np.dtype[Any]]]:
        member = self._archive.NameToInfo[f"{name}.npy"]
        with self._archive.open(member) as file:
            if np.lib.format.read_magic(file) != (1, 0):
                raise ValueError
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(
                file, max_header_size=_MAX_HEADER
            )
            length = math.prod(shape) * dtype.itemsize
            if dtype.hasobject or min(shape, default=0) < 0 or (fortran and len(shape) > 1):
                raise ValueError
            if member.file_size != file.tell() + length:
                raise EOFError
            yield file, shape, dtype


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
    """Open an .npz file.

    Raises:
        ViewError: it cannot be read, is none, is damaged, or unpacks to far more than its size;
            also while its arrays are read.

    """
    try:
        if path.exists() and not path.is_file():
            raise ViewError("is not a file", about=str(path))
        with path.open("rb") as file:
            size = _refuse_large_directory(file)
            with zipfile.ZipFile(file) as archive:
                _refuse_bombs(archive, size)
                yield Arrays(archive)
    except ViewError as problem:
        if problem.about:
            raise
        raise ViewError(str(problem), about=str(path), apart=True) from problem
    except OSError as problem:
        raise ViewError(f"{path} cannot be read: {problem.strerror or problem}") from problem
    except (  # what damage in one place or another of such a file was seen to raise
        zipfile.BadZipFile,
        zlib.error,
        struct.error,
        ValueError,
        EOFError,
        KeyError,
        NotImplementedError,
        RuntimeError,
        OverflowError,
        MemoryError,
    ) as problem:
        raise ViewError(f"{path} is not an undistortion map, or is damaged") from problem


def _refuse_large_directory(file: BinaryIO) -> int:
    """The file's size, where the list of what is in it is short: that is read as a whole.

    As numpy writes it, the record that says so is the file's end, without a comment.
    """
    size = file.seek(0, 2)
    file.seek(max(0, size - 98))
    end = file.read().rjust(98, b"\0")
    if end[76:80] != b"PK\5\6":
        raise zipfile.BadZipFile
    length = struct.unpack_from("<I", end, 88)[0]
    if end[56:60] == b"PK\6\7":  # sizes of 64 bits stand before
        if end[:4] != b"PK\6\6":
            raise zipfile.BadZipFile
        length = struct.unpack_from("<Q", end, 40)[0]
    if length > _MAX_DIRECTORY:
        raise ViewError("holds far more than six arrays")
    file.seek(0)
    return size


def _refuse_bombs(archive: zipfile.ZipFile, size: int) -> None:
    packed = 0
    for member in archive.infolist():
        if member.compress_type == zipfile.ZIP_DEFLATED:
            packed += member.file_size
        elif member.compress_type != zipfile.ZIP_STORED or member.file_size > size:
            raise zipfile.BadZipFile
    if packed > _ALWAYS + _TIMES * size:
        raise ViewError(f"unpacks to {packed / 1e6:,.0f} MB, far more than its size")


@dataclass(frozen=True, kw_only=True, eq=False)
class UndistortMap:
    """Where each pixel of a view comes from in the photo.

    ``cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR)`` renders the view.

    Attributes:
        map_x, map_y: (H, W) float32 pixels of the photo; −1 where ``valid`` is false, which
            ``cv2.remap`` renders black.
        valid: (H, W) whether the camera may be trusted there and the photo has the pixel.
        view: what is rendered.
        image_size: (width, height) of the photos that the map is for.
        redistorts: whether it is the other way round: the result is the camera's photo, and what
            it is for are pictures of the view.

    """

    map_x: npt.NDArray[np.float32]
    map_y: npt.NDArray[np.float32]
    valid: BoolArray
    view: View
    image_size: tuple[int, int]
    redistorts: bool = False


def build_map(camera: PointProjector, view: View) -> UndistortMap:
    """The map (H, W), pixels of the camera's photos, that renders ``view`` from them.

    Rows are done in blocks, on two threads when there are many, so the memory needed beyond
    the map is bounded.

    Raises:
        ViewError: the camera's photos are larger than ``cv2.remap`` can take.

    """
    photo_width, photo_height = camera.image_size
    if max(camera.image_size) > MAX_SIDE:
        raise ViewError(
            f"photos of {photo_width}x{photo_height} cannot be undistorted: "
            f"a side may have {MAX_SIDE} pixels at most"
        )
    width, height = view.size
    if isinstance(view, CrossView):
        return _cross_map(camera, view)
    map_x, map_y = np.empty((2, height, width), np.float32)
    valid = np.empty((height, width), bool)
    put = _filler(camera, view)

    def fill(top: int) -> None:
        rows = slice(top, min(height, top + rows_per_block))
        x, y = map_x[rows], map_y[rows]
        put(rows, x, y)
        # Comparisons with NaN are false. Beyond the outer pixels' centres cv2.remap would
        # blend with the black around the photo.
        if (
            x.min() >= 0 and x.max() <= photo_width - 1 and y.min() >= 0
        ) and y.max() <= photo_height - 1:
            valid[rows] = True
            return
        inside = (x >= 0) & (x <= photo_width - 1) & (y >= 0) & (y <= photo_height - 1)
        valid[rows] = inside
        np.logical_not(inside, out=inside)
        np.copyto(x, OUTSIDE, where=inside)
        np.copyto(y, OUTSIDE, where=inside)

    rows_per_block = max(1, _PIXELS_PER_BLOCK // width)
    tops = range(0, height, rows_per_block)
    if width * height < _PIXELS_FOR_THREADS:
        for top in tops:
            fill(top)
    else:
        with ThreadPoolExecutor(_THREADS) as threads:
            list(threads.map(fill, tops))
    return UndistortMap(
        map_x=map_x, map_y=map_y, valid=valid, view=view, image_size=camera.image_size
    )


def _cross_map(camera: PointProjector, view: CrossView) -> UndistortMap:
    """The faces of a cube, each by its own map, in their places."""
    width, height = view.size
    map_x, map_y = np.full((2, height, width), OUTSIDE, np.float32)
    valid = np.zeros((height, width), bool)
    for (column, row), face in view.placed_faces():
        place = np.s_[row : row + view.side, column : column + view.side]
        part = build_map(camera, face)
        map_x[place], map_y[place], valid[place] = part.map_x, part.map_y, part.valid
    return UndistortMap(
        map_x=map_x, map_y=map_y, valid=valid, view=view, image_size=camera.image_size
    )


def _filler(
    camera: PointProjector, view: View
) -> Callable[[slice, npt.NDArray[np.float32], npt.NDArray[np.float32]], None]:
    """What puts the photo's pixels for rows of the view into two of (h, W), NaN for none."""
    grid = grid_of(camera, view) if isinstance(camera, CubicCamera) else None
    if grid is not None:
        return grid.fill

    project = seen_near(camera) if isinstance(view, PlaneView) else camera.project

    def plain(rows: slice, map_x: npt.NDArray[np.float32], map_y: npt.NDArray[np.float32]) -> None:
        columns = np.arange(view.size[0])
        index = np.arange(rows.start, rows.stop)
        pixel = np.stack(np.broadcast_arrays(columns, index[:, None]), axis=-1)
        map_x[...], map_y[...] = np.moveaxis(project(view.rays(pixel)), -1, 0)

    return plain


def save_map(path: Path | str, undistort_map: UndistortMap, *, overwrite: bool = False) -> None:
    """Write ``undistort_map.npz``: maps (H, W) of pixels, valid, view as JSON, format, image_size.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    with whole_file(Path(path), overwrite=overwrite) as temporary:
        write_npz(temporary, undistort_map)


def write_npz(path: Path, made: UndistortMap) -> None:
    """The same, of a map of either way: ``format`` says which; an existing file is replaced."""
    with path.open("wb") as file:
        np.savez(
            file,
            map_x=made.map_x,
            map_y=made.map_y,
            valid=made.valid,
            view=np.array(made.view.to_json()),
            format=np.array(REDISTORT_FORMAT if made.redistorts else FORMAT),
            image_size=np.array(made.image_size),
        )


def load_map(path: Path | str) -> UndistortMap:
    """Read a map (H, W) of pixels that :func:`save_map` wrote.

    Raises:
        ViewError: the file cannot be read or is not a sound map.

    """
    path = Path(path)
    with opened(path) as arrays:
        missing = [key for key in _KEYS if key not in arrays]
        if missing:
            raise ViewError(f"is not an undistortion map: it has no {missing[0]}", about=str(path))
        known, text, size = (arrays.read(key) for key in ("format", "view", "image_size"))
        if known.shape != () or str(known) != FORMAT:
            raise ViewError("is not a map of a known version: write it again", about=str(path))
        if text.shape != () or text.dtype.kind != "U":
            raise ViewError("the view is not text")
        view = view_from_json(str(text))
        if size.shape != (2,) or size.dtype.kind != "i" or size.min() < 1 or size.max() > MAX_SIDE:
            raise ViewError("image_size must be two whole numbers")
        # Whatever the arrays claim, there is room made for the view's pixels only.
        kinds = {key: arrays.kind(key) for key in ("map_x", "map_y", "valid")}
        if {shape for shape, _ in kinds.values()} != {view.size[::-1]}:
            raise ViewError(f"its maps do not have the view's size {view.size}")
        if [dtype for _, dtype in kinds.values()] != [np.float32, np.float32, np.bool_]:
            raise ViewError("its maps must be float32, and valid must be bool")
        most = 4 * view.size[0] * view.size[1]
        map_x, map_y, valid = (arrays.read(key, max_bytes=most) for key in kinds)
    if not (np.isfinite(map_x).all() and np.isfinite(map_y).all()):
        raise ViewError(f"{path}: its maps hold numbers that are not finite")
    return UndistortMap(
        map_x=map_x,
        map_y=map_y,
        valid=valid,
        view=view,
        image_size=(int(size[0]), int(size[1])),
    )


@dataclass(frozen=True, kw_only=True)
class Crop:
    """A part of a photo.

    Attributes:
        x, y: the pixel of the whole photo that became pixel (0, 0).
        width, height: its size, in the whole photo's pixels.

    """

    x: int
    y: int
    width: int
    height: int


def parse_crop(text: str) -> Crop:
    """``WIDTHxHEIGHT+X+Y`` -> Crop.

    Raises:
        ViewError: the text is not that.

    """
    match = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})\+([0-9]{1,6})\+([0-9]{1,6})", text.strip())
    if match is None:
        raise ViewError(
            f"a crop is WIDTHxHEIGHT+X+Y in pixels of the whole photo, not {quoted(text)}: "
            "such as 640x480+320+160"
        )
    width, height, x, y = map(int, match.groups())
    return Crop(x=x, y=y, width=width, height=height)


def calibrated_pixels(
    pixel: npt.NDArray[np.float64],
    calibrated_size: tuple[int, int],
    size: tuple[int, int],
    crop: Crop | None = None,
) -> npt.NDArray[np.float64]:
    """Pixels (N, 2) of photos of ``size`` -> pixels (N, 2) of the photo as calibrated.

    The way back from the photos that :func:`camera_for_photos` makes a camera for.
    """
    width, start = (crop.width, (crop.x, crop.y)) if crop else (calibrated_size[0], (0, 0))
    return (pixel + 0.5) * (width / size[0]) - 0.5 + np.array(start)


def camera_for_photos(
    camera: CubicCamera, size: tuple[int, int], crop: Crop | None = None
) -> CubicCamera:
    """The camera of photos of ``size``: the calibrated size, or of the same shape.

    Args:
        camera: for the whole photos as they were calibrated.
        size: (width, height) of the photos at hand.
        crop: what part of the whole photo they show; then ``size`` is the part's, or of its
            shape.

    Raises:
        ViewError: the photos are neither, or the crop is not within the whole photo.

    """
    width, height = camera.image_size
    if crop is None:
        crop = Crop(x=0, y=0, width=width, height=height)
        whole = f"the camera was calibrated for {width}x{height}"
        advice = (
            "use photos of that size or of exactly that shape, or say with --crop what part of "
            "the photo they are"
        )
    else:
        if not (crop.width and crop.height) or (
            crop.x + crop.width > width or crop.y + crop.height > height
        ):
            raise ViewError(
                f"the crop {crop.width}x{crop.height}+{crop.x}+{crop.y} does not lie within the "
                f"calibrated photo of {width}x{height}"
            )
        whole = f"the crop is {crop.width}x{crop.height}"
        advice = "use photos of that size or of exactly that shape"
    if size[0] * crop.height != size[1] * crop.width:
        raise ViewError(f"the photo has {size[0]}x{size[1]} pixels, {whole}: {advice}")
    scale = size[0] / crop.width
    if scale == 1 and (crop.x, crop.y) == (0, 0) and size == camera.image_size:
        return camera
    shift_x, shift_y = (scale * (0.5 - start) - 0.5 for start in (crop.x, crop.y))
    affine = np.array([[scale, 0, shift_x], [0, scale, shift_y], [0, 0, 1]])
    radial = camera.radial
    return replace(
        camera,
        image_size=size,
        P=affine @ camera.P,
        radial=RadialCamera(
            image_size=size,
            fx=scale * radial.fx,
            fy=scale * radial.fy,
            cx=scale * radial.cx + shift_x,
            cy=scale * radial.cy + shift_y,
            k=radial.k,
        ),
    )
