"""calib_results.txt, read back by a reader written anew."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import cubic_camera

from cubicfish import CameraFileError
from cubicfish.models import cone_rays
from cubicfish_cli.extensions.formats.ocamcalib import (
    ScaramuzzaLens,
    ocamcalib_text,
    read_ocamcalib,
)
from cubicfish_cli.foreign.file_contents import PlacedLens
from cubicfish_cli.foreign.foreign_files import sniffed

SIZE = (960, 720)


@pytest.fixture(scope="module")
def lens() -> ScaramuzzaLens:
    """A lens with an affine part that no transposition leaves unnoticed."""
    camera = cubic_camera(95)
    rays = cone_rays(np.deg2rad(90), 400)
    fitted = ScaramuzzaLens.of_degree(4, camera, rays, camera.project(rays))
    fitted = fitted.with_inverse(np.deg2rad(90))
    return replace(fitted, stretch=np.array([[1.003, 0.0021], [-0.0013, 0.998]]))


RAYS = cone_rays(np.deg2rad(90), 400)


class Toolbox:
    """The toolbox's C reader as described: values are numbers between remarks; world2cam by invpol.

    Axes: x down the rows, y along the columns, z backwards.
    """

    def __init__(self, text: str) -> None:
        lines = text.split("\n")
        # Line-based readers take the values from these lines.
        self.pol = self.counted(lines[2])
        self.invpol = self.counted(lines[6])
        self.xc, self.yc = map(float, lines[10].split())
        self.c, self.d, self.e = map(float, lines[14].split())
        self.height, self.width = map(int, lines[18].split())
        assert all(lines[i].startswith("#") for i in (0, 4, 8, 12, 16))
        assert all(lines[i] == "" for i in (1, 3, 5, 7, 9, 11, 13, 15, 17, 19))

    @staticmethod
    def counted(line: str) -> list[float]:
        count, *values = line.split()
        assert int(count) == len(values) <= 64
        return [float(value) for value in values]

    def world2cam(self, point: np.ndarray) -> tuple[float, float]:
        norm = math.hypot(point[0], point[1])
        theta = math.atan(point[2] / norm)
        rho = sum(a * theta**i for i, a in enumerate(self.invpol))
        x, y = point[0] / norm * rho, point[1] / norm * rho
        return x * self.c + y * self.d + self.xc, x * self.e + y + self.yc

    def cam2world(self, row: float, column: float) -> np.ndarray:
        det = self.c - self.d * self.e
        x = ((row - self.xc) - self.d * (column - self.yc)) / det
        y = (-self.e * (row - self.xc) + self.c * (column - self.yc)) / det
        r = math.hypot(x, y)
        ray = np.array([x, y, sum(a * r**i for i, a in enumerate(self.pol))])
        return ray / np.linalg.norm(ray)


def test_the_toolbox_sees_the_same_pixels_and_rays(lens: ScaramuzzaLens) -> None:
    toolbox = Toolbox(ocamcalib_text(PlacedLens(lens=lens)))
    assert (toolbox.width, toolbox.height) == SIZE
    assert toolbox.pol[0] < 0
    assert toolbox.pol[1] == 0
    # Their x is our y, their y our x, their z our -z; their pixel is (row, column).
    theirs = RAYS[1:, [1, 0, 2]] * [1, 1, -1]
    rows = np.array([toolbox.world2cam(ray) for ray in theirs])
    assert np.abs(rows[:, ::-1] - lens.project_by_inverse(RAYS[1:])).max() < 1e-6
    pixel = lens.project(RAYS[1:])
    back = np.array([toolbox.cam2world(y, x) for x, y in pixel])
    assert np.abs(back - theirs).max() < 1e-9


def test_it_is_read_back_as_the_same_lens(tmp_path: Path, lens: ScaramuzzaLens) -> None:
    (tmp_path / "a.txt").write_text(ocamcalib_text(PlacedLens(lens=lens)))
    again = read_ocamcalib(tmp_path / "a.txt")
    assert again.image_size == SIZE
    assert np.abs(again.project(RAYS) - lens.project(RAYS)).max() < 1e-9
    assert np.abs(again.project_by_inverse(RAYS) - lens.project_by_inverse(RAYS)).max() < 1e-6


# The layout of the toolbox's own exportData2TXT, with the numbers of its %f and %e and the blanks
# that it leaves at the ends of lines; the lens is made up.
TOOLBOX = """#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB). These are used by cam2world

5 -2.100000e+02 0.000000e+00 2.200000e-03 -4.900000e-06 1.900000e-08 

#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB). These are used by world2cam

3 300.000000 150.000000 -12.000000 

#center: "row" and "column", starting from 0 (C convention)

241.800000 394.500000

#affine parameters "c", "d", "e"

1.000300 0.000200 0.000300

#image size: "height" and "width"

480 752

"""  # noqa: E501, W291


def test_a_file_of_the_toolbox_is_read(tmp_path: Path) -> None:
    path = tmp_path / "calib_results.txt"
    path.write_bytes(TOOLBOX.replace("\n", "\r\n").encode())
    lens = read_ocamcalib(path)
    assert lens.image_size == (752, 480)
    assert (lens.cx, lens.cy) == (394.5, 241.8)
    assert lens.stretch.tolist() == [[1, 0.0003], [0.0002, 1.0003]]
    assert lens.a.tolist() == [210, 0, -2.2e-3, 4.9e-6, -1.9e-8]
    assert lens.inverse.tolist() == [300, 150, -12]


BAD = {
    "empty.txt": ("", "0 lines of numbers, not 5"),
    "cut.txt": (TOOLBOX[:500], "lines of numbers, not 5"),
    "more.txt": (TOOLBOX + "1 2 3\n", "6 lines of numbers, not 5"),
    "count.txt": (TOOLBOX.replace("5 -2.1", "6 -2.1"), "line 3: the polynomial must be a count"),
    "nan.txt": (TOOLBOX.replace("150.000000", "nan"), "line 7: the inverse polynomial must hold"),
    "inf.txt": (TOOLBOX.replace("394.500000", "1e999"), "line 11: the center must hold finite"),
    "word.txt": (TOOLBOX.replace("394.5", "x"), "line 11: the center must hold finite"),
    "centre.txt": (TOOLBOX.replace("241.800000 394.5", "394.5"), "line 11: 2 numbers are expected"),
    "sign.txt": (
        TOOLBOX.replace("-2.1000", "2.1000"),
        "line 3: the first coefficient has the wrong sign",
    ),
    "flat.txt": (TOOLBOX.replace("1.000300", "0.0"), "c must be near 1"),
    "size.txt": (TOOLBOX.replace("480 752", "480 0"), "line 19: the image size must be two whole"),
    "short.txt": (TOOLBOX.replace("480 752", "480"), "line 19: 2 numbers are expected"),
    "one.txt": (TOOLBOX.replace(TOOLBOX.split("\n")[2], "1 -210"), "fewer than two coefficients"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, says = BAD[name]
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(CameraFileError) as refusal:
        read_ocamcalib(path)
    assert says in str(refusal.value)
    assert name in str(refusal.value)
    assert "\n" not in str(refusal.value)


@given(st.binary(max_size=400), st.sampled_from([b"", TOOLBOX[:120].encode(), b"5 1 2 3 4 5\n"]))
def test_any_bytes_are_read_or_refused(tmp_path_factory, raw: bytes, head: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.txt"
    path.write_bytes(head + raw)
    with pytest.raises(CameraFileError) as refusal:
        read_ocamcalib(path)
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_export_tells_what_the_inverse_polynomial_loses(run, calibrated, tmp_path: Path) -> None:
    path = tmp_path / "calib_results.txt"
    said = run(
        *("export", "--to", "ocamcalib", "-m", calibrated / "camera.yaml", "-o", path),
        *("--max-error", 3),
    ).stdout
    line = next(line for line in said.splitlines() if "world2cam by the inverse polynomial" in line)
    assert f"#{line}" in path.read_text().splitlines()[20:]
    Toolbox(path.read_text())


def test_words_that_others_use_too_are_looked_for_last(tmp_path: Path) -> None:
    path = tmp_path / "transforms.json"
    path.write_text('{"fl_x": 200.0, "cam2world": []}')
    assert sniffed(path) == "nerfstudio"
    path.write_text(TOOLBOX)
    assert sniffed(path) == "ocamcalib"
