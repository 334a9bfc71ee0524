"""Maps for other programs: OpenCV's, STMaps, and ffmpeg's pair of pictures.

All of them have, for each pixel of the result, its place in the source. Pixels without a place in
the source are negative, or beyond the frame where a format has no negative numbers.

The virtual camera of a view is written as a file in plain YAML.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish import OutputError, UndistortMap, UsageError, View
from cubicfish.files import Content
from cubicfish.views import CentralView, MapInBands
from cubicfish_cli.undistortion.images import encode_picture, part_name
from cubicfish_cli.words.phrases import shell_line

Floats = npt.NDArray[np.float32]
Shorts = npt.NDArray[np.uint16]

_NO_PLACE = -1.0
_BEYOND = 65_535
_BLOCK_PIXELS = 1_000_000


def stmap(pixel_map: UndistortMap) -> tuple[Floats, Floats]:
    """The map as shares of the source's frame, 0 to 1 from edge to edge: two of (H, W) float32.

    Pixel centres are at half pixels; −1 marks pixels without a place in the source. The second
    array counts upwards from the bottom, as Nuke and Flame do.
    """
    width, height = pixel_map.image_size
    u = (pixel_map.map_x.astype(float) + 0.5) / width
    v = 1 - (pixel_map.map_y.astype(float) + 0.5) / height
    u[pixel_map.empty] = v[pixel_map.empty] = _NO_PLACE
    return u.astype(np.float32), v.astype(np.float32)


def write_exr(path: Path, made: MapInBands) -> None:
    """STMap: R and G hold x and y as 32-bit floats, B is 0.

    Raises:
        OutputError: the extra ``exr`` is not installed.
        OSError: the file cannot be written.

    """
    library = require_exr(path)
    width, height = made.size
    u, v = np.empty((2, height, width), np.float32)
    for rows, band in made:
        u[rows], v[rows] = stmap(band)
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    with library.File(header, {"R": u, "G": v, "B": np.zeros_like(u)}) as file:
        try:
            file.write(str(path))
        except RuntimeError as problem:  # '... image file "NAME". No space left on device.'
            raise OSError(str(problem).rpartition('". ')[2].rstrip(".")) from problem


def require_exr(path: Path) -> Any:
    """Import the library that writes EXR files; ``path`` is the file that the user named.

    Raises:
        OutputError: the extra ``exr`` is not installed.

    """
    try:
        import OpenEXR
    except ImportError as problem:
        raise OutputError(
            f"{path}: EXR files need one more package: pip install 'cubicfish[exr]'"
        ) from problem
    return OpenEXR


def png_values(pixel_map: UndistortMap) -> tuple[Shorts, Shorts]:
    """STMap in 16 bits, x and y (H, W): value / 65535 is the share of the frame.

    The half pixel at the frame's edge is never 0, so 0 marks pixels without a place in the source.
    """
    u, v = (np.round(part * 65_535.0) for part in stmap(pixel_map))
    empty = pixel_map.empty
    return np.where(empty, 0, u).astype(np.uint16), np.where(empty, 0, v).astype(np.uint16)


def pgm_values(pixel_map: UndistortMap) -> tuple[Shorts, Shorts]:
    """Maps for ffmpeg's remap filter, x and y (H, W): whole source pixels, 65535 for no place."""
    empty = pixel_map.empty
    x, y = (np.rint(part) for part in (pixel_map.map_x, pixel_map.map_y))
    x[empty] = y[empty] = _BEYOND
    return x.astype(np.uint16), y.astype(np.uint16)


def ffmpeg_command(path_x: Path, path_y: Path) -> str:
    """The command line that applies a pair of PGM files to a video."""
    inputs = ("-i", "in.mp4", "-i", path_x, "-i", path_y)
    how = ("-lavfi", "remap=fill=black", "-c:a", "copy", "out.mp4")
    return shell_line("ffmpeg", *inputs, *how)


def map_paths(output: Path, parts: Sequence[str] = ("",)) -> dict[str, tuple[Path, ...]]:
    """The files of which each part of a map named ``output`` consists.

    Raises:
        UsageError: the name's suffix is none of .npz, .exr, .png and .pgm.
        OutputError: it is .exr and the extra ``exr`` is not installed.

    """
    suffix = output.suffix.lower()
    if suffix not in (".npz", ".exr", *_PAIRS):
        raise UsageError(
            f"{output}: maps are written as .npz, .exr, .png, .pgm: choose a name that ends so"
        )
    if suffix == ".exr":
        require_exr(output)  # before the work, and by the name that the user knows
    axes = ("x", "y") if suffix in _PAIRS else ("",)
    return {
        part: tuple(part_name(part_name(output, part), axis) for axis in axes) for part in parts
    }


def map_contents(paths: Sequence[Path], made: MapInBands) -> dict[Path, Content]:
    """The contents of the files of one map, as :func:`write_files` takes them.

    The map is made while the first is written; of the second its numbers are kept until then.
    """
    suffix = paths[0].suffix.lower()
    if suffix not in _PAIRS:
        write: Content = made.write if suffix == ".npz" else partial(write_exr, made=made)
        return {paths[0]: write}
    width, height = made.size
    pair: list[Shorts] = []

    def write_next(path: Path) -> None:
        if not pair:
            pair.extend(np.empty((2, height, width), np.uint16))
            for rows, band in made:
                pair[0][rows], pair[1][rows] = _PAIRS[suffix](band)
        _write_grey(path, pair.pop(0))

    return dict.fromkeys(paths, write_next)


def _write_grey(path: Path, values: Shorts) -> None:
    """Write numbers (H, W) as a grey picture of 16 bits."""
    if path.suffix.lower() != ".pgm":
        path.write_bytes(encode_picture(path, values))
        return
    height, width = values.shape
    with path.open("wb") as file:
        file.write(f"P5\n{width} {height}\n{_BEYOND}\n".encode())
        step = max(1, _BLOCK_PIXELS // width)
        for top in range(0, height, step):
            values[top : top + step].astype(">u2").tofile(file)


_PAIRS: Mapping[str, Callable[[UndistortMap], tuple[Shorts, Shorts]]] = {
    ".png": png_values,
    ".pgm": pgm_values,
}


FORMAT_VERSION = 1


def view_files(
    maps: Mapping[str, UndistortMap | MapInBands], *, mask: Path | None = None, beside: Path | None
) -> dict[Path, Content]:
    """The mask and the virtual camera of each part of a view, as :func:`write_files` takes them.

    Args:
        maps: part -> its map.
        mask: the path of masks; None for no masks.
        beside: the path after which the cameras' files are named; None for no such files.

    Raises:
        OutputError: no picture can have the mask's name.

    """
    files: dict[Path, Content] = {}
    for part, made in maps.items():
        if mask is not None:
            files[part_name(mask, part)] = encode_picture(mask, np.uint8(255) * made.valid)
        if beside is not None:
            files[camera_path(beside, part)] = view_text(made.view)
    return files


def camera_path(beside: Path, part: str = "") -> Path:
    """Where the virtual camera of a part of a view goes, by what it goes beside."""
    return part_name(beside, part).with_suffix(".view.yaml")


def view_text(view: View) -> str:
    """The text of a file of the virtual camera, in the style of camera.yaml.

    ``K`` has the picture's scale in its middle, and is a pinhole's matrix if the kind is
    ``perspective``; ``camera_from_view`` is a rotation vector in radians.
    """
    lines = [
        f"cubicfish_view: {FORMAT_VERSION}",
        f"kind: {view.kind}",
        f"image_size: {list(view.size)}",
    ]
    if isinstance(view, CentralView):
        lines += ["K:", *(f"- {row}" for row in view.camera_matrix.tolist())]
        lines += [f"camera_from_view: {list(view.rotation)}"]
        lines += [f"hfov_deg: {view.hfov_deg!r}", f"vfov_deg: {view.vfov_deg!r}"]
    else:
        own = [one for one in view.as_record().items() if one[0] not in ("kind", "size")]
        lines += [f"{key}: {value}" for key, value in own]
    return "\n".join(lines) + "\n"
