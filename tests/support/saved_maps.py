"""``undistort_map.npz`` as a program of the user's reads it: with numpy alone."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish import View
from cubicfish.views import CentralView


@dataclass(frozen=True, kw_only=True, eq=False)
class SavedMap:
    """What is in the file, ``view`` as its JSON has it."""

    map_x: np.ndarray
    map_y: np.ndarray
    valid: np.ndarray
    view: dict[str, Any]
    format: str
    image_size: tuple[int, ...]

    @property
    def central_view(self) -> CentralView:
        """The view itself, of a kind that has a focal length."""
        kind, *values = (self.view[key] for key in ("kind", "size", "focal", "rotation"))
        size, focal, rotation = values
        return CentralView(kind=kind, size=tuple(size), focal=focal, rotation=tuple(rotation))


def read_map(path: Path) -> SavedMap:
    with np.load(path, allow_pickle=False) as data:
        assert {*data.files} == {"map_x", "map_y", "valid", "view", "format", "image_size"}
        assert data["map_x"].dtype == data["map_y"].dtype == np.float32
        assert data["valid"].dtype == bool
        return SavedMap(
            map_x=data["map_x"],
            map_y=data["map_y"],
            valid=data["valid"],
            view=json.loads(str(data["view"])),
            format=str(data["format"]),
            image_size=tuple(data["image_size"].tolist()),
        )


def every_pixel(view: View) -> np.ndarray:
    """(H, W, 2) every pixel of a view."""
    width, height = view.size
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
