"""Files of the right size that hold too much: what they would unfold to is refused before."""

import math
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fuzz_foreign as foreign
import pytest
from fuzz_readers import READERS

import cubicfish_cli
from cubicfish import CubicfishError
from cubicfish.files import plain_yaml, reading, tables
from cubicfish_cli.extensions.formats import vnlog
from cubicfish_cli.extensions.formats.nerfstudio_json import read_nerfstudio
from cubicfish_cli.foreign import file_contents
from cubicfish_cli.foreign.foreign_files import read_foreign

ROOT = Path(cubicfish_cli.__file__).parents[1]
# Row of the table in files/reading.py -> modules whose bounds it has.
BOUNDED = {
    "target.yaml": ("cubicfish/target/target", "cubicfish/files/plain_yaml"),
    "camera.yaml, rig.yaml": (
        "cubicfish/io/camera_keys",
        "cubicfish/rigs/rig",
        "cubicfish/files/plain_yaml",
    ),
    "other cameras as YAML, XML, JSON": (
        "cubicfish_cli/extensions/formats/opencv_cameras",
        "cubicfish_cli/foreign/file_contents",
    ),
    "OCamCalib's text": ("cubicfish_cli/extensions/formats/ocamcalib",),
    "JSON of nerfstudio": (
        "cubicfish_cli/extensions/formats/nerfstudio_json",
        "cubicfish_cli/foreign/file_contents",
    ),
    "COLMAP's cameras": ("cubicfish_cli/extensions/formats/colmap_cameras",),
    ".cameramodel": ("cubicfish_cli/extensions/formats/mrcal_model", "cubicfish/files/plain_yaml"),
    "tables: corners, pairs, poses": ("cubicfish/files/tables",),
    "corners.vnl": ("cubicfish_cli/extensions/formats/vnlog",),
    "calib_data.mat, PhotonVision's": (
        "cubicfish_cli/extensions/formats/board_tables",
        "cubicfish_cli/foreign/file_contents",
    ),
    "points, pixels": ("cubicfish_cli/commands/points",),
    "photos, each of those under way": ("cubicfish/photos/photos",),
}
UNLISTED = {"cubicfish/files/fingerprint"}  # the digest of any input
UNITS = {
    "BYTES": (("GB", 1e9), ("MB", 1e6)),
    "VALUES": (("million values", 1e6), ("values", 1)),
    "LINES": (("million lines", 1e6),),
    "PIXELS": (("million pixels", 1e6),),
}
_BOUND = re.compile(r"^_?MAX_(?:FILE_)?(BYTES|VALUES|LINES|PIXELS) = ([\d_* ]+)$", re.MULTILINE)

MOST = 1000
_TOO_MUCH = r"more than [15],000|too much in it"


def bounds_of(module: str) -> dict[str, int]:
    """Bytes, values, lines and pixels beyond which a module's reader refuses a file."""
    found = _BOUND.findall((ROOT / f"{module}.py").read_text(encoding="utf-8"))
    return {kind: math.prod(map(int, number.split("*"))) for kind, number in found}


def test_the_list_of_bounds_has_every_reader_with_its_own() -> None:
    lines = (reading.__doc__ or "").split(f"{'=' * 37}  ")[2].strip().splitlines()
    listed = {line[:37].strip(): line[39:65].strip() for line in lines[1:]}
    assert listed.keys() == BOUNDED.keys()
    for row, modules in BOUNDED.items():
        for module in modules:
            for kind, bound in bounds_of(module).items():
                words = [f"{round(bound / one):,} {unit}" for unit, one in UNITS[kind]]
                assert any(re.search(rf"\b{text}\b", listed[row]) for text in words), (row, module)
    bounded = {
        path.relative_to(ROOT).with_suffix("").as_posix()
        for path in ROOT.glob("cubicfish*/**/*.py")
    }
    bounded = {module for module in bounded if bounds_of(module)}
    assert bounded == {one for modules in BOUNDED.values() for one in modules} | UNLISTED


@pytest.mark.parametrize(
    ("module", "bound", "read", "suffix", "text"),
    [
        (plain_yaml, "MAX_VALUES", READERS["camera.yaml"].read, ".yaml",
         "a: [{}1]".format("1," * MOST)),
        (tables, "MAX_VALUES", READERS["corners.csv"].read, ".csv", "image,board\n" + ",\n" * MOST),
        (tables, "MAX_VALUES", READERS["corners.csv"].read, ".csv", "," * (MOST + 1)),
        (vnlog, "MAX_LINES", foreign.read_corners, ".vnl", "# filename x y\n" + "\n" * MOST),
        (vnlog, "MAX_LINES", foreign.read_corners, ".vnl", "# filename x y" + "\r" * (MOST + 1)),
        (file_contents, "MAX_VALUES", read_nerfstudio, ".json",
         '{{"a": [{}1]}}'.format("[]," * MOST)),
        (plain_yaml, "MAX_VALUES", foreign.look_through_mrcal, ".cameramodel",
         "{{'a': [{}]}}".format("1," * (MOST + 1))),
    ],
)  # fmt: skip
def test_more_values_than_a_bound_are_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: Any,
    bound: str,
    read: Callable[[Path], object],
    suffix: str,
    text: str,
) -> None:
    path = tmp_path / f"input{suffix}"
    path.write_text(text, newline="")
    monkeypatch.setattr(module, bound, MOST)
    with pytest.raises(CubicfishError, match=_TOO_MUCH):
        read(path)
    monkeypatch.setattr(module, bound, 5 * MOST)
    with pytest.raises(CubicfishError, match=rf"^(?!.*({_TOO_MUCH}))"):
        read(path)


def test_directives_that_take_the_parser_hours_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("%YAML 1.2\n--- [1]\n")
    assert plain_yaml.load_plain_yaml(path, error=CubicfishError) == [1]
    path.write_text("".join(f"%TAG !{number}! b\n" for number in range(11)) + "--- [1]\n")
    with pytest.raises(CubicfishError, match="directives"):
        plain_yaml.load_plain_yaml(path, error=CubicfishError)


@pytest.mark.parametrize("text", ["\n" * 4000, " " * 100_000, "\n" * 300_000 + "1 PINHOLE"])
def test_blanks_take_no_time_to_look_through(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text + "x")
    begin = time.process_time()
    with pytest.raises(CubicfishError, match="no format that is known"):
        read_foreign(path)
    # One pass takes milliseconds; patterns that try every blank with every other, minutes.
    assert time.process_time() - begin < 5
