"""Camera files of other tools that are fuzzed: read, and looked through as `import` does."""

import struct
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from fuzz_foreign import RAYS, SIZE

from cubicfish_cli.fitting.conversion.models import MODELS
from cubicfish_cli.formats.colmap_models import MODELS as COLMAP_MODELS
from cubicfish_cli.formats.foreign import foreign_text, read_foreign
from cubicfish_cli.model.lens_record import LensRecord

LENS = LensRecord(
    model="kannala_brandt",
    values={"fx": 200.0, "fy": 201.0, "cx": 320.0, "cy": 240.0, "k": np.array([0.1, -0.02, 0, 0])},
    image_size=SIZE,
)
_K = np.array([[200.0, 0, 320], [0, 201, 240], [0, 0, 1]])


def look_through(name: str | None) -> Callable[[Path], object]:
    """A reader of the format ``name``, or of whatever format a file looks like."""

    def read(path: Path) -> object:
        record, _ = read_foreign(path, name=name)
        with np.errstate(all="ignore"):  # made-up lenses bend rays beyond all numbers
            return MODELS[record.model].project(record, RAYS)

    return read


def seeds(name: str) -> Sequence[bytes]:
    poses = {"a.png": (np.eye(3), np.zeros(3))}
    return [foreign_text(name, LENS, ["a note"], poses).encode()]


def opencv_seeds() -> Sequence[bytes]:
    """As OpenCV itself writes them, in its three syntaxes."""
    made = seeds("opencv")
    with tempfile.TemporaryDirectory() as folder:
        for syntax in ("yml", "xml", "json"):
            path = Path(folder) / f"camera.{syntax}"
            storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
            for key, value in (
                ("image_width", 640), ("image_height", 480), ("fisheye_model", 1),
                ("camera_matrix", _K), ("distortion_coefficients", np.array([0.1, -0.02, 0, 0])),
            ):  # fmt: skip
                storage.write(key, value)
            storage.release()
            made = [*made, path.read_bytes()]
    return made


def colmap_text_seeds() -> Sequence[bytes]:
    rows = [
        " ".join(["1", name, *map(str, SIZE), *map(str, _parameters(model.parameters))])
        for name, model in COLMAP_MODELS.items()
    ]
    return [b"# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n" + row.encode() for row in rows]


def colmap_binary_seeds() -> Sequence[bytes]:
    made = []
    for model in COLMAP_MODELS.values():
        values = _parameters(model.parameters)
        made.append(struct.pack(f"<QIiQQ{len(values)}d", 1, 1, model.number, *SIZE, *values))
    return made


def _parameters(names: Sequence[str]) -> list[float]:
    known = {"f": 200.0, "fx": 200.0, "fy": 201.0, "cx": 320.0, "cy": 240.0}
    return [known.get(name, 0.01) for name in names]
