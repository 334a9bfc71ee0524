"""What is fuzzed: every reader of files that come from outside, with files it can read."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import cv2
import fuzz_foreign as foreign
import fuzz_lenses as lenses
import numpy as np

from cubicfish import CubicfishError, Target, load_camera, load_corners
from cubicfish.io.corners_csv import load_correspondences
from cubicfish.photos import PictureFile
from cubicfish_cli.commands.points import read_points

SAMPLE = Path(__file__).parents[3] / "sample_data"
LONGEST_MESSAGE = 2000


@dataclass(frozen=True, kw_only=True)
class Reader:
    """A reader and files that it accepts.

    Attributes:
        read: reads a file and uses what it got as a command would.
        seeds: contents that it accepts.
        suffix: of the file's name.
        words: text that means something to it, beyond what the seeds hold.

    """

    read: Callable[[Path], object]
    seeds: Callable[[], Sequence[bytes]]
    suffix: str
    words: tuple[str, ...] = ()


def problem_with(reader: Reader, path: Path) -> str | None:
    """None when the file is read, or refused as it should be: in one line that can be shown.

    Any other exception goes through.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            reader.read(path)
        except CubicfishError as error:
            message = str(error)
            if not message or "\n" in message or len(message) > LONGEST_MESSAGE:
                return f"the message is not one line: {message[:300]!r}"
            if not message.isprintable():
                return f"the message cannot be shown: {message[:300]!r}"
    return None


def _target() -> Path:
    return SAMPLE / "target.yaml"


def _target_seeds() -> Sequence[bytes]:
    marked = (
        "units: mm\nboards:\n"
        "  - {name: a, type: charuco, corners: [4, 3], square: 30, marker: 22, "
        "dictionary: DICT_4X4_50, first_marker: 3, first_square: light, origin: [0, 0, 0], "
        "x_axis: [1, 0, 0], y_axis: [0, 1, 0]}\n"
        "  - {name: b, type: aprilgrid, tags: [3, 2], tag: 0.03e+3, spacing: .3, "
        "family: tag36h11, first_marker: 0, origin: [0, 0, 100], x_axis: [0, 1, 0], "
        "y_axis: [1, 0, 0]}\n"
        "  - name: c\n    type: points\n    points: [[0, 0, 1], [1, 0, 0], [0, 1, 1.5]]\n"
    )
    return [_target().read_bytes(), marked.encode()]


def _read_target(path: Path) -> object:
    target = Target.load(path)
    return [board.world_points([0, board.columns - 1], [0, board.rows - 1])
            for board in target.boards]  # fmt: skip


def _corners_seeds() -> Sequence[bytes]:
    lines = (SAMPLE / "true_corners.csv").read_text().splitlines()[:60]
    weighted = [lines[0], lines[1] + ",weight", *(f"{line},0.5" for line in lines[2:30])]
    return ["\n".join(lines).encode(), "\r\n".join(weighted).encode()]


def _read_corners(path: Path) -> object:
    target = _loaded_target()
    return load_corners(path, target)


@cache
def _loaded_target():
    return Target.load(_target())


def _correspondence_seeds() -> Sequence[bytes]:
    rows = [f"a.png,{i},{2 * i},-1e-3,{i}.5,{3 * i}" for i in range(20)]
    return [
        "\n".join(["# cubicfish correspondences 1, image_size 640x480", "image,X,Y,Z,x,y", *rows])
        .encode()
    ]  # fmt: skip


def _camera_seeds() -> Sequence[bytes]:
    from fuzz_cameras import camera_files

    return camera_files()


def _read_camera(path: Path) -> object:
    loaded = load_camera(path, any_lift=True)
    camera = loaded.camera
    width, height = camera.image_size
    rays = np.array([[0.1, 0.2, 1.0], [1, 0, 1e-3], [0, -1, -0.5]])
    pixel = camera.project(rays)
    if hasattr(camera, "unproject"):
        pixel = camera.unproject(np.array([[width / 2, height / 2], [0, 0]]))
    return pixel


@cache
def _picture_seeds() -> Sequence[bytes]:
    rng = np.random.default_rng(1)
    grey = rng.integers(0, 255, (60, 72), np.uint8)
    colour = rng.integers(0, 255, (60, 72, 3), np.uint8)
    seeds = []
    for suffix in (".png", ".jpg", ".tif", ".bmp", ".webp", ".pgm", ".ppm"):
        for picture in (
            (colour,)
            if suffix == ".ppm"
            else (grey,)
            if suffix == ".pgm"
            else (
                grey,
                colour,
            )
        ):
            done, data = cv2.imencode(suffix, picture)
            if done:  # not every OpenCV writes every format
                seeds.append(data.tobytes())
    for depth in (".png", ".tif"):
        seeds.append(cv2.imencode(depth, grey.astype(np.uint16) * 257)[1].tobytes())
    seeds.append(b"P2\n# grey\n3 2\n255\n0 1 2\n3 4 255\n")
    return seeds


def _read_photo(path: Path) -> object:
    file = PictureFile.read(path)
    size, picture = file.size, file.picture(floats=True)
    return size, picture.shape


def _view_seeds() -> Sequence[bytes]:
    return [b"x,y,z\n1,2,3\n-0.5;nan;1e5\n", b"0.1 0.2 1\n\n# comment\n1 0 1e-3\n"]


READERS = {
    "target.yaml": Reader(
        read=_read_target, seeds=_target_seeds, suffix=".yaml", words=("DICT_7X7_1000", "units: m")
    ),
    "corners.csv": Reader(read=_read_corners, seeds=_corners_seeds, suffix=".csv"),
    "correspondences.csv": Reader(
        read=load_correspondences, seeds=_correspondence_seeds, suffix=".csv"
    ),
    "camera.yaml": Reader(read=_read_camera, seeds=_camera_seeds, suffix=".yaml"),
    "photos": Reader(read=_read_photo, seeds=_picture_seeds, suffix=".png"),
    "points": Reader(
        read=lambda path: read_points(path, ("x", "y", "z")), seeds=_view_seeds, suffix=".csv"
    ),
    "calib_results.txt": Reader(
        read=foreign.look_through_ocamcalib, seeds=foreign.ocamcalib_seeds, suffix=".txt"
    ),
    ".cameramodel": Reader(
        read=foreign.look_through_mrcal, seeds=foreign.mrcal_seeds, suffix=".cameramodel"
    ),
    **{
        f"FileStorage.{syntax}": Reader(
            read=lenses.look_through("opencv"),
            seeds=lenses.storage_seeds(syntax),
            suffix=f".{syntax}",
            words=lenses.KEYS,
        )
        for syntax in ("yml", "xml", "json")
    },
    "cameras.txt": Reader(
        read=lenses.look_through("colmap"),
        seeds=lenses.colmap_text_seeds,
        suffix=".txt",
    ),
    "cameras.bin": Reader(
        read=lenses.look_through("colmap"), seeds=lenses.colmap_binary_seeds, suffix=".bin"
    ),
    **{
        name: Reader(
            read=lenses.look_through(name),
            seeds=partial(lenses.exported_seeds, name),
            suffix="",
        )
        for name in lenses.EXPORTED
    },
    "any camera": Reader(
        read=lenses.look_through(None), seeds=lenses.all_seeds, suffix="", words=lenses.KEYS
    ),
    "corners.vnl": Reader(read=foreign.read_corners, seeds=foreign.vnlog_seeds, suffix=".vnl"),
    "calib_data.mat": Reader(
        read=foreign.read_corners, seeds=foreign.calib_data_seeds, suffix=".mat"
    ),
    "photonvision.json": Reader(
        read=foreign.read_corners, seeds=foreign.photonvision_seeds, suffix=".json"
    ),
}

_WORDS = """
nan .nan inf -.inf 1e308 -1e308 1e999 1e-320 0 -0.0 -1 2147483648 18446744073709551616 0x10 010
1_000 1,5 1.5.2 &a *a !!python/object:os.system << --- ... null ~ true no | > ? : , [ ] { } # ' "
%s {} \\ ../../etc/passwd /dev/zero ٣ ½ é
"""
WORDS = (
    *_WORDS.split(),
    *("\n", "\r\n", "\t", " ", "\0", "\ufeff", "\u2028", "\x85", "\x1b[31m", "\ud7ff"),
)
