"""Maps for other programs: OpenCV's, STMaps, and ffmpeg's pair of pictures.

All of them have, for each pixel of the result, its place in the source. Pixels without a place in
the source are negative, or beyond the frame where a format has no negative numbers.

The virtual camera of a view is written as a file in plain YAML.
"""

import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.undistortion.images import encode_picture, part_name
from cubicfish_cli.core.errors import OutputError, UsageError, ViewError
from cubicfish_cli.core.files import Content, whole_file
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.views.fields import in_picture
from cubicfish_cli.core.views.maps import OUTSIDE, UndistortMap
from cubicfish_cli.core.views.view import MAX_SIDE, CentralView, View

Floats = npt.NDArray[np.float32]
Shorts = npt.NDArray[np.uint16]

_BEYOND = 65_535
_ROWS_PER_BLOCK = 32


def build_redistort_map(camera: CubicCamera, view: View) -> UndistortMap:
    """The map that renders the camera's photo again from a picture of the view.

    Raises:
        ViewError: the camera's photos are larger than ``cv2.remap`` can take.

    """
    width, height = camera.image_size
    if max(width, height) > MAX_SIDE:
        raise ViewError(f"a side of a photo may have {MAX_SIDE} pixels at most")
    x, y = np.full((2, height, width), OUTSIDE, np.float32)
    valid = np.zeros((height, width), bool)
    for top in range(0, height, _ROWS_PER_BLOCK):
        rows = slice(top, min(height, top + _ROWS_PER_BLOCK))
        pixel = np.stack(
            np.meshgrid(np.arange(width), np.arange(rows.start, rows.stop)), axis=-1
        ).astype(float)
        source = view.pixels(camera.unproject(pixel))
        inside = in_picture(source, view.size)
        valid[rows] = inside
        x[rows][inside], y[rows][inside] = source[inside].T
    return UndistortMap(
        map_x=x, map_y=y, valid=valid, view=view, image_size=view.size, redistorts=True
    )


def stmap(pixel_map: UndistortMap) -> tuple[Floats, Floats]:
    """The map as shares of the source's frame, 0 to 1 from edge to edge: two of (H, W) float32.

    Pixel centres are at half pixels; −1 marks pixels without a place in the source. The second
    array counts upwards from the bottom, as Nuke and Flame do.
    """
    width, height = pixel_map.image_size
    u = (pixel_map.map_x.astype(float) + 0.5) / width
    v = 1 - (pixel_map.map_y.astype(float) + 0.5) / height
    u[pixel_map.empty] = v[pixel_map.empty] = OUTSIDE
    return u.astype(np.float32), v.astype(np.float32)


def save_map(path: Path | str, undistort_map: UndistortMap, *, overwrite: bool = False) -> None:
    """Write ``undistort_map.npz``: maps (H, W) of pixels, valid, view as JSON, format, image_size.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    with whole_file(Path(path), overwrite=overwrite) as temporary:
        write_npz(temporary, undistort_map)


def write_npz(path: Path, made: UndistortMap) -> None:
    """Write such a file of a map of either direction (``format``), over an existing file too."""
    way = "redistort_map" if made.redistorts else "undistort_map"
    with path.open("wb") as file:
        np.savez(
            file,
            map_x=made.map_x,
            map_y=made.map_y,
            valid=made.valid,
            view=np.array(json.dumps(made.view.as_record())),
            format=np.array(f"cubicfish {way} 1"),
            image_size=np.array(made.image_size),
        )


def write_exr(path: Path, made: UndistortMap) -> None:
    """STMap: R and G hold x and y as 32-bit floats, B is 0.

    Raises:
        OutputError: the extra ``exr`` is not installed.
        OSError: the file cannot be written.

    """
    u, v = stmap(made)
    library = require_exr(path)
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
    x, y = (
        np.where(pixel_map.empty, _BEYOND, np.rint(part)).astype(np.uint16)
        for part in (pixel_map.map_x, pixel_map.map_y)
    )
    return x, y


def ffmpeg_command(path_x: Path, path_y: Path) -> str:
    """The command line that applies a pair of PGM files to a video."""
    maps = f"-i {shlex.quote(str(path_x))} -i {shlex.quote(str(path_y))}"
    return f"ffmpeg -i in.mp4 {maps} -lavfi remap=fill=black -c:a copy out.mp4"


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


def map_contents(paths: Sequence[Path], made: UndistortMap) -> dict[Path, Content]:
    """The contents of the files of one map, as :func:`write_files` takes them."""
    suffix = paths[0].suffix.lower()
    if suffix in _PAIRS:
        values = _PAIRS[suffix](made)
        return {path: encode_picture(path, one) for path, one in zip(paths, values, strict=True)}
    return {paths[0]: partial(write_npz if suffix == ".npz" else write_exr, made=made)}


_PAIRS: Mapping[str, Callable[[UndistortMap], tuple[Shorts, Shorts]]] = {
    ".png": png_values,
    ".pgm": pgm_values,
}


FORMAT_VERSION = 1


def view_files(
    maps: Mapping[str, UndistortMap], *, mask: Path | None = None, beside: Path | None
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
            path = part_name(beside, part).with_suffix(".view.yaml")
            files[path] = view_text(made.view)
    return files


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
