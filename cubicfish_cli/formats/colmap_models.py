"""COLMAP's camera models: their numbers, their parameters, and the lenses that they are.

Its pixel (0, 0) is the top-left CORNER of the first pixel: centres are half a pixel more than here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.fields import focal, numbers
from cubicfish_cli.lenses.division import DivisionLens
from cubicfish_cli.lenses.enhanced_unified import EnhancedUnifiedLens
from cubicfish_cli.lenses.field_of_view import FieldOfViewLens
from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.lenses.pinhole import PinholeLens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.lenses.thin_prism import RadTanThinPrismLens, ThinPrismLens

HALF = 0.5


@dataclass(frozen=True, kw_only=True)
class ColmapModel:
    """One of COLMAP's camera models.

    Attributes:
        number: what ``cameras.bin`` calls it.
        parameters: in COLMAP's order; f stands for fx and fy. Those behind cx and cy have the
            names of the lens's own parameters.
        lens: which lens it is.

    """

    number: int
    parameters: tuple[str, ...]
    lens: type[Lens]


def _model(number: int, lens: type[Lens], parameters: str) -> ColmapModel:
    return ColmapModel(number=number, lens=lens, parameters=tuple(parameters.split()))


MODELS = {
    "SIMPLE_PINHOLE": _model(0, PinholeLens, "f cx cy"),
    "PINHOLE": _model(1, PinholeLens, "fx fy cx cy"),
    "SIMPLE_RADIAL": _model(2, PinholeLens, "f cx cy k1"),
    "RADIAL": _model(3, PinholeLens, "f cx cy k1 k2"),
    "OPENCV": _model(4, PinholeLens, "fx fy cx cy k1 k2 p1 p2"),
    "OPENCV_FISHEYE": _model(5, RadialCamera, "fx fy cx cy k1 k2 k3 k4"),
    "FULL_OPENCV": _model(6, PinholeLens, "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
    "FOV": _model(7, FieldOfViewLens, "fx fy cx cy omega"),
    "SIMPLE_RADIAL_FISHEYE": _model(8, RadialCamera, "f cx cy k1"),
    "RADIAL_FISHEYE": _model(9, RadialCamera, "f cx cy k1 k2"),
    "THIN_PRISM_FISHEYE": _model(
        10, ThinPrismLens, "fx fy cx cy k1 k2 t2 t1 k3 k4 s1 s3"
    ),
    "RAD_TAN_THIN_PRISM_FISHEYE": _model(
        11, RadTanThinPrismLens, "fx fy cx cy k1 k2 k3 k4 k5 k6 t1 t2 s1 s2 s3 s4"
    ),
    "SIMPLE_DIVISION": _model(12, DivisionLens, "f cx cy bend"),
    "DIVISION": _model(13, DivisionLens, "fx fy cx cy bend"),
    "SIMPLE_FISHEYE": _model(14, RadialCamera, "f cx cy"),
    "FISHEYE": _model(15, RadialCamera, "fx fy cx cy"),
    "EUCM": _model(16, EnhancedUnifiedLens, "fx fy cx cy alpha beta"),
}  # fmt: skip
"""COLMAP's name -> the model. EQUIRECTANGULAR, 17, is no lens."""

WRITTEN: Mapping[type[Lens], str] = {
    RadialCamera: "OPENCV_FISHEYE",
    ThinPrismLens: "THIN_PRISM_FISHEYE",
    RadTanThinPrismLens: "RAD_TAN_THIN_PRISM_FISHEYE",
    EnhancedUnifiedLens: "EUCM",
}
"""A lens -> the COLMAP model that it is written as."""

_LENGTHS: Mapping[type[Lens], Mapping[str, int]] = {
    RadialCamera: {"k": 4},
    ThinPrismLens: {"k": 4, "t": 2, "s": 4},
    RadTanThinPrismLens: {"k": 6, "t": 2, "s": 4},
}
_PINHOLE = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def parameters_of(lens: Lens) -> tuple[str, list[float]]:
    """The COLMAP model and parameters of a lens of one of :data:`WRITTEN`'s models.

    A pinhole's distortion is left out: a flat picture has none.

    Raises:
        CameraFileError: the lens's values lie outside what COLMAP takes.

    """
    name = {**WRITTEN, PinholeLens: "PINHOLE"}[type(lens)]
    own = dict(zip(lens.parameter_names, lens.parameters.tolist(), strict=True))
    own["cx"], own["cy"] = own["cx"] + HALF, own["cy"] + HALF
    if name == "EUCM" and not (0 <= own["alpha"] <= 1 and own["beta"] > 0):
        raise CameraFileError(
            "COLMAP takes an EUCM with alpha from 0 to 1 and beta above 0 only, which the lens "
            "nearest to this camera is not: export to colmap"
        )
    return name, [own[parameter] for parameter in MODELS[name].parameters]


def lens_of(where: Path, name: str, given: Sequence[float], image_size: tuple[int, int]) -> Lens:
    """The lens of a COLMAP model with these parameters.

    Raises:
        CameraFileError: they are not as many, or not those of a lens; ``where`` begins the line.

    """
    model = MODELS[name]
    count = len(model.parameters)
    values = numbers(where, list(given), f"PARAMS of {name}", (count,)).tolist()
    own = dict(zip(model.parameters, values, strict=True))
    if "f" in own:
        own["fx"] = own["fy"] = own["f"]
    focal(where, np.array([own["fx"], own["fy"]]), "PARAMS")
    record: dict[str, Any] = {
        "fx": own["fx"], "fy": own["fy"], "cx": own["cx"] - HALF, "cy": own["cy"] - HALF,
    }  # fmt: skip
    if model.lens is PinholeLens:
        record["d"] = np.array([own.get(key, 0.0) for key in _PINHOLE])
    elif model.lens in _LENGTHS:
        for key, length in _LENGTHS[model.lens].items():
            record[key] = np.array([own.get(f"{key}{i + 1}", 0.0) for i in range(length)])
    else:
        record |= {key: own[key] for key in ("omega", "bend", "alpha", "beta") if key in own}
    return model.lens(image_size=image_size, **record)
