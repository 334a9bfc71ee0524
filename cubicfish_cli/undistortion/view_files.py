"""The virtual camera of a view as files: plain YAML, and what OpenCV's FileStorage reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.files import Content
from cubicfish_cli.undistortion.images import check_suffix, encode_picture
from cubicfish_cli.undistortion.maps import UndistortMap
from cubicfish_cli.undistortion.plane import PlaneView
from cubicfish_cli.undistortion.projections import EquidistantView, PerspectiveView
from cubicfish_cli.undistortion.view import CentralView, View

FORMAT_VERSION = 1

Masked = Callable[[UndistortMap], npt.NDArray[np.bool_]]
"""Map -> where its picture may be trusted, (H, W)."""


def part_name(path: Path, part: str) -> Path:
    """``flat.png`` and ``front`` -> ``flat_front.png``; as it is for a view of one part."""
    return path.with_name(f"{path.stem}_{part}{path.suffix}") if part else path


def view_files(
    maps: Mapping[str, UndistortMap],
    *,
    mask: Path | None,
    beside: Path | None,
    masked: Masked | None = None,
) -> dict[Path, Content]:
    """The mask and the virtual camera of each part of a view, as :func:`write_files` takes them.

    Args:
        maps: part -> its map.
        mask: where masks go; None for none.
        beside: what the cameras' files are called after; None for none.
        masked: says what a mask shows; by default where the map is valid.

    Raises:
        OutputError: no picture can have the mask's name.

    """
    files: dict[Path, Content] = {}
    for part, made in maps.items():
        if mask is not None:
            check_suffix(mask)
            shown = mask_picture(masked(made) if masked else made.valid)
            files[part_name(mask, part)] = encode_picture(mask, shown)
        if beside is not None:
            plain, opencv = view_file_names(part_name(beside, part))
            files[plain] = view_text(made.view)
            files[opencv] = partial(write_opencv_view, view=made.view)
    return files


def view_file_names(output: Path) -> tuple[Path, Path]:
    """Where the two files of an output's virtual camera go: beside it."""
    return output.with_suffix(".view.yaml"), output.with_suffix(".view.opencv.yaml")


def view_text(view: View) -> str:
    """The virtual camera in the style of camera.yaml.

    ``K`` has the picture's scale in its middle, and is a pinhole's matrix where the kind is
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
        lines += [f"{key}: {value}" for key, value in view.parameters().items()]
    return "\n".join(lines) + "\n"


def write_opencv_view(path: Path, view: View) -> None:
    """The virtual camera as OpenCV's FileStorage YAML.

    A perspective view is a pinhole without distortion, an equidistant one OpenCV's fisheye
    without coefficients; other kinds have no camera in OpenCV, and ``model`` says so.
    """
    width, height = view.size
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_FORMAT_YAML)
    try:
        storage.write("image_width", width)
        storage.write("image_height", height)
        model, coefficients = _opencv_model(view)
        storage.write("model", model)
        if isinstance(view, CentralView):
            storage.write("camera_matrix", view.camera_matrix)
            storage.write("distortion_coefficients", np.zeros((coefficients, 1)))
            storage.write("camera_from_view", view.camera_from_view)
        elif isinstance(view, PlaneView):
            storage.write("camera_from_pixel", view.camera_from_pixel)
    finally:
        storage.release()


def _opencv_model(view: View) -> tuple[str, int]:
    if isinstance(view, PerspectiveView):
        return "pinhole", 5
    if isinstance(view, EquidistantView):
        return "fisheye", 4
    return view.kind, 4


def mask_picture(valid: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """Whether each pixel may be trusted (H, W) -> a picture, 255 where it may and 0 elsewhere."""
    return np.asarray(valid, np.uint8) * np.uint8(255)
