"""Camera files of other tools that are fuzzed, read as ``cubicfish import`` reads them."""

import json
import struct
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

import cv2
import numpy as np
from fuzz_cameras import camera
from fuzz_foreign import RAYS

from cubicfish.fit import to_lens
from cubicfish_cli.extension_guard import read_formats
from cubicfish_cli.extensions.formats.colmap_cameras import MODELS as COLMAP_MODELS
from cubicfish_cli.foreign.file_contents import PlacedLens
from cubicfish_cli.foreign.foreign_files import read_foreign, sniffed

SIZE = (640, 480)
_FILES = Path(__file__).parents[2] / "cubicfish_cli/extensions/formats/camera_files"
K = np.array([[300.0, 0, 320.5], [0, 301.5, 239], [0, 0, 1]])
# More than what is exported is read of the others: fuzz_readers.py has them one by one.
_SEEDED = {"opencv", "colmap", "ocamcalib", "mrcal"}
EXPORTED = [name for name in read_formats() if name not in _SEEDED]
KEYS = (
    "camera_matrix", "K", "M1", "distortion_coefficients", "D", "xi", "image_size", "image_width",
    "fisheye_model", "model", "fisheye", "pinhole", "rows", "cols", "data", "opencv_storage", "_",
    "<!DOCTYPE a [<!ENTITY b 'c'>]>", "&b;", "&#0;", "<a>", "</a>", "<_>", "]]>", "<![CDATA[",
    '<?xml version="1.0" encoding="utf-16"?>', "$base64$",
)  # fmt: skip


def look_through(name: str | None) -> Callable[[Path], object]:
    """A reader of one format, or of whatever the file looks like."""

    def look(path: Path) -> object:
        lens, _ = read_foreign(path, name=name)
        return lens.project(RAYS)

    return look


def storage_seeds(syntax: str) -> Callable[[], Sequence[bytes]]:
    """FileStorage as OpenCV writes it."""

    def seeds() -> Sequence[bytes]:
        written = []
        for d, more in (
            (np.array([[-0.02, 0.003, -4e-4, 1e-5]]), {"fisheye_model": 1}),
            (np.array([[-0.2, 0.05, 1e-3, -5e-4, 0.01]]), {"time": "Fri 20 Nov", "a": 1.5}),
            (np.array([[-0.2, 0.05, 1e-3, -5e-4]]), {"xi": np.array([[1.1]])}),
            (np.arange(1, 15)[None] * 1e-3, {}),
        ):
            storage = cv2.FileStorage(f".{syntax}", cv2.FILE_STORAGE_WRITE | cv2.FileStorage_MEMORY)
            values = {"image_width": 640, "image_height": 480, "K": K, "D": d, **more}
            for key, value in values.items():
                storage.write(key, value)
            written.append(storage.releaseAndGetString().encode())
        return written

    return seeds


@cache
def exported_seeds(read: str) -> Sequence[bytes]:
    """Files that are read under this name, as ``cubicfish export`` writes them or a test has."""
    poses = {"a.png": (np.eye(3), np.zeros(3))}
    made = read_formats()[read]
    lenses = [resolve_name(how["lens"]) for how in made.written.values()]
    if not lenses:
        return [file.read_bytes() for file in sorted(_FILES.iterdir()) if sniffed(file) == read]
    return [
        resolve_name(made.write)(
            PlacedLens(lens=to_lens(camera(), lens).lens, note=["a note"], poses=poses)
        ).encode()
        for lens in lenses
    ]


@cache
def all_seeds() -> Sequence[bytes]:
    return [
        *(seed for read in ("colmap", *EXPORTED) for seed in exported_seeds(read)),
        *(storage_seeds(syntax)()[0] for syntax in ("yml", "xml", "json")),
        colmap_binary_seeds()[0],
        json.dumps({"mtx": K.tolist(), "dist": [[0.1] * 5], "resolution": SIZE}).encode(),
    ]


def colmap_text_seeds() -> Sequence[bytes]:
    """A cameras.txt as exported, and one for each model."""
    rows = [
        " ".join(map(str, (1, name, *SIZE, *_parameters(model.parameters))))
        for name, model in COLMAP_MODELS.items()
    ]
    return [*exported_seeds("colmap"), *(f"# CAMERA_ID, MODEL\n{row}\n".encode() for row in rows)]


def colmap_binary_seeds() -> Sequence[bytes]:
    """A cameras.bin for each model."""
    seeds = []
    for model in COLMAP_MODELS.values():
        values = _parameters(model.parameters)
        head = struct.pack("<QIiQQ", 1, 1, model.number, *SIZE)
        seeds.append(head + struct.pack(f"<{len(values)}d", *values))
    return seeds


def _parameters(names: Sequence[str]) -> list[float]:
    known = {"f": 300.0, "fx": 300.0, "fy": 301.0, "cx": 320.0, "cy": 240.0}
    return [known.get(name, 1e-3) for name in names]
