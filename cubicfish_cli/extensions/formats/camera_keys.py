"""Camera files that hold a known lens under keys of their own: what the keys of each are.

YAML, XML and JSON are taken apart to single values: ``{"cam0": {"resolution": [640, 480]}}`` holds
``cam0.resolution.0`` and ``cam0.resolution.1``. A :class:`Layout` names the keys of a program's
files; the table at the end has those of programs whose files are only read.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish import CameraFileError, quoted
from cubicfish.models import Lens, RadialCamera
from cubicfish_cli.extensions.formats.colmap_cameras import RadialPolyLens, ThinPrismLens
from cubicfish_cli.extensions.formats.lenses import (
    DoubleSphereLens,
    PinholeLens,
    UnifiedLens,
    named_lens,
)
from cubicfish_cli.extensions.formats.ocamcalib import ScaramuzzaLens, refuse_no_camera
from cubicfish_cli.extensions.formats.opencv_cameras import read_file_storage
from cubicfish_cli.foreign.file_contents import chosen_camera, numbers, size

Make = type[Lens] | Callable[[Path, tuple[int, int], Mapping[str, float]], Lens]
"""A lens, or what makes one of a place for messages, the photos' size and named numbers."""

_MAX_DEPTH = 12
_LIST = re.compile(r"([\w.]+)\[(.*)\]")


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where the files of a program have a camera's lens.

    Keys are those of the camera; one that begins with / is the file's, and {} in it is the camera's
    name. Parameters of a lens stand one after another, ``name`` or ``name=key``, with a question
    mark where the file may lack it, which is 0 then. ``part.`` stands before the keys that follow
    it, ``key[a,,b]`` are the numbers of a list, of which the second is not used, and ``!key`` must
    be 0, since no lens that is known has it.

    Attributes:
        file: what to call the file; {} is the lens's kind.
        camera: a pattern of a key that each camera has: its first group is what stands before the
            camera's keys, its last one the camera's name.
        kind: the keys that say which lens it is.
        usual: the lens where the file does not say.
        lenses: by kind, the lens and its parameters.
        size: the keys of the photos' width and height.
        first: what the middle of the first pixel is called, along x and y.
        from_middle: whether cx and cy count from the middle of the photo.

    """

    file: str
    camera: str = "()"
    kind: tuple[str, ...] = ()
    usual: str = ""
    lenses: Mapping[str, tuple[Make, str]]
    size: tuple[str, str]
    first: float = 0.0
    from_middle: bool = False

    def find_cameras(self, values: Mapping[str, Any]) -> dict[str, str]:
        """Return the names of the cameras, and what stands before the keys of each."""
        found = (re.match(self.camera, key) for key in values)
        return {one[one.re.groups].rstrip("."): one[1] for one in found if one}

    def read(self, camera: "_Camera", image_size: tuple[int, int] | None) -> Lens:
        """Return the lens of a camera.

        Raises:
            CameraFileError: it is not known, or a value is missing or wrong; one line.

        """
        kind = self._choose_lens(camera)
        camera = replace(camera, file=self.file.format(f"{kind} " if kind else ""))
        photos = self._read_size(camera) or image_size
        if photos is None:
            raise CameraFileError(
                f"{camera.where} does not say how large the photos are: add --size WxH"
            )
        make, parameters = self.lenses[kind]
        named = camera.read_named(parameters)
        for centre, side in zip(("cx", "cy"), photos, strict=True):
            named[centre] += (side / 2 if self.from_middle else 0.0) - self.first
        if isinstance(make, type):
            return named_lens(camera.where, make, photos, named)
        return make(camera.where, photos, named)

    def _choose_lens(self, camera: "_Camera") -> str:
        given = [str(camera.values.get(camera.key(key), "")) for key in self.kind]
        said = "-".join(given) or self.usual
        for name in self.lenses:
            if name.casefold() == said.casefold():
                return name
        keys = " and ".join(map(camera.key, self.kind))
        raise CameraFileError(
            f"{camera.where}: {keys} {quoted(said)} is no lens that is known here: known: "
            + ", ".join(self.lenses)
        )

    def _read_size(self, camera: "_Camera") -> tuple[int, int] | None:
        keys = [*map(camera.key, self.size)]
        width, height = map(camera.values.get, keys)
        if width is None and height is None:
            return None
        return size(camera.where, width, height, " and ".join(keys))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Camera:
    """A camera of a file: all values of the file, and what stands before those of the camera."""

    path: Path
    file: str
    values: Mapping[str, Any]
    name: str
    before: str

    @property
    def where(self) -> Path:
        return Path(f"{self.path}, {self.file}")

    def key(self, key: str) -> str:
        return key[1:].format(self.name) if key.startswith("/") else self.before + key

    def read_named(self, parameters: str) -> dict[str, float]:
        """Return numbers by the names of a layout's parameters."""
        named: dict[str, float] = {}
        part = ""
        for one in parameters.split():
            name, _, key = one.rstrip("?").partition("=")
            if one.endswith("."):
                part = one
            elif in_list := _LIST.fullmatch(one):
                named |= self._read_list(self.key(part + in_list[1]), in_list[2].split(","))
            elif one.startswith("!"):
                self._refuse_unless_zero(self.key(part + one[1:]))
            else:
                at = self.key(part + (key or name))
                named[name] = self._read_number(at, optional=one.endswith("?"))
        return named

    def _read_number(self, key: str, *, optional: bool) -> float:
        if key not in self.values:
            if optional:
                return 0.0
            raise CameraFileError(f"{self.where}: {key} is not there")
        return float(numbers(self.where, [self.values[key]], key, (1,))[0])

    def _read_list(self, key: str, names: list[str]) -> dict[str, float]:
        least = sum(not name.endswith("?") for name in names)
        found = [self.values.get(f"{key}.{number}") for number in range(len(names) + 1)]
        given = [*takewhile(lambda one: one is not None, found)]
        values = numbers(self.where, given, key, tuple(range(least, len(names) + 1))).tolist()
        return {name.rstrip("?"): value for name, value in zip(names, values, strict=False) if name}

    def _refuse_unless_zero(self, key: str) -> None:
        if self._read_number(key, optional=True):
            raise CameraFileError(
                f"{self.where}: {key} is not 0, and no lens that is known here has it"
            )


class Program:
    """A program, whose files have one layout or another."""

    def __init__(self, *layouts: Layout) -> None:
        self._layouts = layouts

    def read(
        self, path: Path, *, camera: str | None = None, image_size: tuple[int, int] | None = None
    ) -> Lens:
        """Read the lens of a camera in one of the program's files.

        Args:
            path: the file.
            camera: the camera's name; not needed where there is one.
            image_size: (width, height) of the photos, if the file does not say.

        Raises:
            CameraFileError: the file is not one of the program's, or holds no such camera; one
                line.

        """
        values: dict[str, Any] = {}
        for key, value in _take_apart(read_file_storage(path), "", 0):
            if key in values:
                raise CameraFileError(f"{path}: the key {quoted(key)} is there twice")
            values[key] = value
        for layout in self._layouts:
            file, cameras = layout.file.format(""), layout.find_cameras(values)
            if cameras:
                name = chosen_camera(path, list(cameras), camera)
                own = _Camera(path=path, file=file, values=values, name=name, before=cameras[name])
                return layout.read(own, image_size)
        file = self._layouts[0].file.format("")
        raise CameraFileError(f"{path} is not {file}: no camera is in it where such files have it")


def _take_apart(value: Any, key: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Give keys and single values of mappings and lists; what lies too deep is no lens."""
    if isinstance(value, list):
        value = {str(number): one for number, one in enumerate(value)}
    if not isinstance(value, dict):
        yield key, value
    elif depth < _MAX_DEPTH:
        for name, one in value.items():
            yield from _take_apart(one, f"{key}.{name}" if key else name, depth + 1)


# Lenses whose numbers files have otherwise -------------------------------------------------------


def _make_radial_poly(where: Path, photos: tuple[int, int], named: Mapping[str, float]) -> Lens:
    first = named["k1"]
    over = {f"k{n - 1}": named[f"k{n}"] / (first or 1.0) for n in (2, 3, 4)}
    core = {"fx": first, "fy": first * named["aspect"], "cx": named["cx"], "cy": named["cy"]}
    return named_lens(where, RadialPolyLens, photos, core | over)


def _make_metashape(lens: type[Lens]) -> Make:
    def make(where: Path, photos: tuple[int, int], named: Mapping[str, float]) -> Lens:
        focal = {"fx": named["f"] + named["b1"], "fy": named["f"]}
        return named_lens(where, lens, photos, {**named, **focal})

    return make


def _make_scaramuzza(where: Path, photos: tuple[int, int], named: Mapping[str, float]) -> Lens:
    stretch = np.array([[named["c"], named["d"]], [named["e"], named["f"]]])
    lens = ScaramuzzaLens(
        image_size=photos,
        cx=named["cx"],
        cy=named["cy"],
        stretch=stretch,
        a=np.array([named["a0"], 0.0, named["a2"], named["a3"], named["a4"]]),
    )
    refuse_no_camera(where, lens)
    return lens


# The table ---------------------------------------------------------------------------------------

_CORE = "fx fy cx cy"
_KB4 = f"{_CORE} k1 k2 k3 k4"
_BROWN = f"{_CORE} k1 k2 p1 p2"

read_camodocal = Program(
    Layout(
        file="a camodocal {}file",
        kind=("model_type",),
        lenses={
            "MEI": (
                UnifiedLens,
                "mirror_parameters. xi distortion_parameters. k1 k2 p1 p2 "
                "projection_parameters. fx=gamma1 fy=gamma2 cx=u0 cy=v0",
            ),
            # Its k1 is 1.
            "KANNALA_BRANDT": (
                RadialCamera,
                "projection_parameters. k1=k2 k2=k3 k3=k4 k4=k5 fx=mu fy=mv cx=u0 cy=v0",
            ),
            "PINHOLE": (
                PinholeLens,
                f"distortion_parameters. k1 k2 p1 p2 projection_parameters. {_CORE}",
            ),
        },
        size=("image_width", "image_height"),
    )
).read

read_orbslam = Program(
    Layout(
        file="an ORB-SLAM {}settings file",
        camera=r"(Camera\d?\.)fx",
        kind=("/Camera.type",),
        usual="PinHole",
        lenses={
            "KannalaBrandt8": (RadialCamera, _KB4),
            "PinHole": (PinholeLens, f"{_BROWN} k3?"),
            "Rectified": (PinholeLens, _CORE),
        },
        size=("/Camera.width", "/Camera.height"),
    )
).read

read_stella = Program(
    Layout(
        file="a stella_vslam {}file",
        camera=r"(Camera\.)fx",
        kind=("model",),
        lenses={
            "fisheye": (RadialCamera, _KB4),
            "perspective": (PinholeLens, f"{_BROWN} k3"),
        },
        size=("cols", "rows"),
    )
).read

_BASALT: Mapping[str, tuple[Make, str]] = {
    "ds": (DoubleSphereLens, f"{_CORE} xi alpha"),
    "kb4": (RadialCamera, _KB4),
    "pinhole": (PinholeLens, _CORE),
    "pinhole-radtan8": (PinholeLens, f"{_BROWN} k3 k4 k5 k6"),
}
read_basalt = Program(
    Layout(
        file="a basalt {}calibration",
        camera=r"(value0\.intrinsics\.(\d+)\.)camera_type",
        kind=("camera_type",),
        lenses={kind: (lens, f"intrinsics. {named}") for kind, (lens, named) in _BASALT.items()},
        size=("/value0.resolution.{}.0", "/value0.resolution.{}.1"),
    ),
    Layout(
        file="a {}file of basalt's lenses",
        camera=r"((camera_?\d+)\.)camera_type",
        kind=("camera_type",),
        lenses={kind: (lens, f"intrinsics.0. {named}") for kind, (lens, named) in _BASALT.items()},
        size=("resolution.0.0", "resolution.0.1"),
    ),
).read

# Its own projection.py: the middle of the first pixel is (0, 0), and the photo's (w - 1) / 2.
read_woodscape = Program(
    Layout(
        file="a WoodScape {}calibration",
        camera=r"(intrinsic\.)model",
        kind=("model",),
        lenses={
            "radial_poly": (
                _make_radial_poly,
                "k1 k2 k3 k4 cx=cx_offset cy=cy_offset aspect=aspect_ratio",
            )
        },
        size=("width", "height"),
        first=0.5,
        from_middle=True,
    )
).read

# Its manual: the middle of the first pixel is (0.5, 0.5), and cx, cy count from the photo's middle.
_FISHEYE = (
    _make_metashape(ThinPrismLens),
    "f cx cy k1? k2? k3? k4? t1=p1? t2=p2? b1? skew=b2? !p3 !p4",
)
read_metashape = Program(
    Layout(
        file="a Metashape {}calibration",
        kind=("projection",),
        lenses={
            "fisheye": _FISHEYE,
            "equidistant_fisheye": _FISHEYE,
            # Its p1 is OpenCV's p2.
            "frame": (
                _make_metashape(PinholeLens),
                "f cx cy k1? k2? k3? p1=p2? p2=p1? b1? !k4 !b2 !p3 !p4",
            ),
        },
        size=("width", "height"),
        first=0.5,
        from_middle=True,
    )
).read

# MATLAB calls the middle of the first pixel (1, 1), and gives rows before columns.
read_matlab = Program(
    Layout(
        file="MATLAB's fisheyeIntrinsics",
        camera=r"((?:\w+\.)?)MappingCoefficients\.0",
        lenses={
            "": (
                _make_scaramuzza,
                "MappingCoefficients[a0,a2,a3,a4] DistortionCenter[cx,cy] "
                "StretchMatrix.0[c,d] StretchMatrix.1[e,f]",
            )
        },
        size=("ImageSize.1", "ImageSize.0"),
        first=1.0,
    )
).read
