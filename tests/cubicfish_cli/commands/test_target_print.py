"""``cubicfish target print``: pages measured as a printer makes them."""

import json
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from looking import look_at
from running import Run
from samples import SAMPLE
from synthetic import IMAGE_SIZE, TRUE_LENS, rays_in_cone

from cubicfish import Target, aligned_difference, load_camera
from cubicfish.find import find_grids
from cubicfish.scene.faces import board_face
from cubicfish.scene.photos import render
from cubicfish.target import Board
from cubicfish_cli.extensions.printing.command import PrintOptions
from cubicfish_cli.extensions.printing.layout import (
    Page,
    boards_in_millimetres,
    lay_out,
    quiet_zone,
)
from cubicfish_cli.extensions.printing.objects import design
from cubicfish_cli.extensions.printing.paper import paper
from cubicfish_cli.render import drawing as extra
from tests.cubicfish_cli.commands.test_main import CUBICFISH, heavy_modules_after

pytest.importorskip("matplotlib")
needs_poppler = pytest.mark.skipif(shutil.which("pdftoppm") is None, reason="needs poppler-utils")
MARGIN = 8.0
INCH = 25.4


def pictures(pdf: Path, dpi: int) -> list[np.ndarray]:
    """The pages of a PDF as grey pictures."""
    stem = pdf.with_suffix("")
    subprocess.run(["pdftoppm", "-gray", "-r", str(dpi), pdf, stem], check=True)
    files = sorted(pdf.parent.glob(f"{stem.name}-*.pgm"))
    pages = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]
    for file in files:
        file.unlink()
    return pages


def page_sizes(pdf: Path) -> list[tuple[float, float]]:
    """Width and height of each page in millimetres, from its MediaBox."""
    boxes = [
        line.split(b"[")[1].split(b"]")[0].split()
        for line in pdf.read_bytes().splitlines()
        if b"/MediaBox" in line
    ]
    return [(float(box[2]) * INCH / 72, float(box[3]) * INCH / 72) for box in boxes]


def edge_errors(
    picture: np.ndarray, board: Board, corner: tuple[float, float], dpi: int
) -> np.ndarray:
    """How far every side of every square is from its place, in millimetres, signed.

    Along the middle of every row (and column) of squares, ink in the pixels around a side says
    where the side is, to a small part of a pixel.
    """
    errors = []
    for axis, (count, other) in enumerate(
        [(board.columns, board.rows), (board.rows, board.columns)]
    ):
        image = picture if axis == 0 else picture.T
        along, across = corner[axis], corner[1 - axis]
        for row in range(-1, other):
            y = round((across + (row + 0.5) * board.square) / INCH * dpi)
            ink = 1 - image[y - 3 : y + 4].mean(axis=0) / 255
            for side in range(-1, count + 1):
                place = (along + side * board.square) / INCH * dpi
                first, last = round(place - 5), round(place + 5)
                dark = ink[first:last].sum()
                before = ink[first] > 0.5
                if before == (ink[last - 1] > 0.5):
                    continue  # at the rim where a light square ends
                found = first + dark if before else last - dark
                errors.append((found - place) / dpi * INCH)
    return np.array(errors)


@pytest.mark.slow
@needs_poppler
def test_every_side_of_every_square_is_in_its_place(run: Run, tmp_path: Path) -> None:
    said = run("target", "print", "--object", "corner", "-o", tmp_path / "printed", "--json").stdout
    record = json.loads(said)
    pdf = tmp_path / "printed" / "boards.pdf"
    boards = boards_in_millimetres(Target.load(tmp_path / "printed" / "target.yaml"))
    _, made = design(PrintOptions(kind="corner"), paper("A4"), margin=MARGIN)
    for width, height in page_sizes(pdf):
        assert (width, height) == pytest.approx((297, 210), abs=1e-4)
    for picture, board, here, page in zip(
        pictures(pdf, 300), boards, made, record["pages"], strict=True
    ):
        assert picture.shape == pytest.approx((210 / INCH * 300, 297 / INCH * 300), abs=1)
        assert page["board"] == board.name
        errors = edge_errors(picture, board, page["corner_0_0_mm"], 300)
        # The ruler has a tick every millimetre.
        (left, top), pixels = here.strip, 300 / INCH
        start = (left + 12) * pixels
        ruler = picture[round((top + 4.4 - 1.3) * pixels)]
        ruler = 1 - ruler[round(start) - 5 : round(start + 100 * pixels) + 6] / 255
        for k in range(101):
            at = round(5 + k * pixels)
            around = np.arange(at - 4, at + 5)
            tick = (ruler[around] @ (around + 0.5)) / ruler[around].sum()
            place = tick + round(start) - 5
            assert abs(place - start - k * pixels) < 0.05 * pixels
        # Two sides for each inner line and row, one at the rim of dark squares.
        assert len(errors) > 2 * board.columns * board.rows
        assert np.abs(errors).max() < 0.05
        assert abs(errors.mean()) < 0.01


def drawn(page: Page, shape: tuple[int, int], dpi: int) -> np.ndarray:
    """What the renderer has of the page at the middle of each pixel: ink, outside the strip."""
    y, x = np.indices(shape)
    place = (np.stack([x, y], axis=-1) + 0.5) / dpi * INCH
    return board_face(page.board, margin=0.0).is_dark(place - page.shift)


@pytest.mark.slow
@needs_poppler
@pytest.mark.parametrize("board_type", ["checkerboard", "charuco", "aprilgrid"])
def test_the_print_is_what_the_renderer_draws(run: Run, tmp_path: Path, board_type: str) -> None:
    run("target", "print", "--object", "board", "--type", board_type, "-o", tmp_path, "-q")
    (board,) = boards_in_millimetres(Target.load(tmp_path / "target.yaml"))
    page = lay_out(board, paper("A4"), margin=MARGIN)
    (picture,) = pictures(tmp_path / "boards.pdf", 150)
    ink = drawn(page, picture.shape, 150)
    _, top = page.strip
    rows = slice(0, int((top - 0.5) / INCH * 150))
    assert page.turned is False
    # Pixels on a side are grey; none other differs.
    sure = cv2.erode(ink.astype(np.uint8), np.ones((3, 3))) == 1
    blank = cv2.dilate(ink.astype(np.uint8), np.ones((3, 3))) == 0
    face, white = board_face(board, margin=0.0), quiet_zone(board)
    # The ruler along y has its place in the white, at 1.6 mm and more from the board.
    x = (np.arange(picture.shape[1]) + 0.5) / 150 * INCH - page.shift[0]
    blank &= (x > face.lower[0] - 1.5) & (x < face.upper[0] + 1.5)
    assert sure[rows].mean() > 0.15
    assert (picture[rows][sure[rows]] == 0).all()  # no white hair between black and black
    assert (picture[rows][blank[rows]] == 255).all()
    assert top - page.shift[1] - face.upper[1] >= white - 1e-6


@pytest.mark.slow
@needs_poppler
@pytest.mark.parametrize("kind", ["corner", "box"])
def test_the_finder_sees_each_board_and_nothing_else(run: Run, tmp_path: Path, kind: str) -> None:
    run("target", "print", "--object", kind, "-o", tmp_path, "-q")
    target = Target.load(tmp_path / "target.yaml")
    for picture, board in zip(pictures(tmp_path / "boards.pdf", 100), target.boards, strict=True):
        (grid,) = find_grids(picture).grids
        size = sorted((np.ptp(grid.cells, axis=0) + 1).tolist())
        assert size == sorted([board.columns, board.rows])
        assert len(grid.pixel) == board.columns * board.rows


@pytest.mark.slow
@needs_poppler
@pytest.mark.parametrize("board_type", ["charuco", "aprilgrid"])
def test_opencv_reads_the_markers(run: Run, tmp_path: Path, board_type: str) -> None:
    args = ["target", "print", "--object", "corner", "--type", board_type, "--json"]
    record = json.loads(run(*args, "-o", tmp_path).stdout)
    target = Target.load(tmp_path / "target.yaml")
    for picture, board, said in zip(
        pictures(tmp_path / "boards.pdf", 150), target.boards, record["pages"], strict=True
    ):
        assert board.markers is not None
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.markers.dictionary))
        options = cv2.aruco.DetectorParameters()
        options.markerBorderBits = 1 if board_type == "charuco" else 2
        corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, options).detectMarkers(picture)
        where = {
            int(number): quad.reshape(4, 2).mean(axis=0)
            for number, quad in zip(ids.ravel(), corners, strict=True)
        }
        cells = board.marker_cells()
        assert sorted(where) == sorted(cells[:, 0].tolist())
        pitch = board.square * (1 + board.spacing)
        middle = (-0.5, -0.5) if board_type == "charuco" else (0.5, 0.5)
        for number, column, row in cells.tolist():
            place = (
                np.array([column, row]) * pitch + np.array(middle) * board.square
                + said["corner_0_0_mm"]
            )  # fmt: skip
            np.testing.assert_allclose(where[number], place / INCH * 150, atol=2.0)
        if board_type == "charuco":
            peer = cv2.aruco.CharucoBoard(
                (board.columns + 1, board.rows + 1), board.square, board.markers.side, dictionary,
                cells[:, 0].astype(np.int32),
            )  # fmt: skip
            found, names, _, _ = cv2.aruco.CharucoDetector(peer).detectBoard(picture)
            assert len(names) == board.columns * board.rows
            row, column = np.divmod(names.ravel(), board.columns)
            place = board.plane_points(column, row) + said["corner_0_0_mm"]
            np.testing.assert_allclose(found.reshape(-1, 2), place / INCH * 150 - 0.5, atol=1.0)


@pytest.mark.slow
def test_an_existing_target_in_its_unit(run: Run, tmp_path: Path) -> None:
    text = (SAMPLE / "target.yaml").read_text().replace("units: mm", "units: cm")
    small = tmp_path / "target.yaml"
    small.write_text(text.replace("square: 25", "square: 2.5"))
    said = run("target", "print", small, "--paper", "tabloid", "-o", tmp_path / "pages").stdout
    assert "floor  checkerboard  9x6             25  250 x 175" in said
    assert [path.name for path in (tmp_path / "pages").iterdir()] == ["boards.pdf"]


@pytest.mark.slow
def test_pages_are_the_same_bytes_again_and_are_not_replaced(run: Run, tmp_path: Path) -> None:
    args = ["target", "print", "--object", "corner", "--paper", "Letter"]
    run(*args, "-o", tmp_path / "a")
    first = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert sorted(first) == ["boards.pdf", "target.yaml"]
    assert all(b"CreationDate" not in data for data in first.values())
    again = subprocess.run(
        [*CUBICFISH, *args, "-o", tmp_path / "b"], capture_output=True, check=True
    )
    assert b"wrote" in again.stdout
    assert {path.name: path.read_bytes() for path in (tmp_path / "b").iterdir()} == first
    (tmp_path / "a" / "boards.pdf").unlink()
    said = run(*args, "-o", tmp_path / "a", code=1).stderr
    assert "target.yaml exists already" in said
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["target.yaml"]


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        ([], 2, "make a target with --object"),
        (["t.yaml", "--object", "box"], 2, "give the one or the other"),
        (["t.yaml", "--square", "3mm"], 2, "give the one or the other"),
        (["--object", "box", "--corners", "9x6"], 2, "take --object board"),
        (["--object", "board", "--dictionary", "DICT_4X4_50"], 2, "add --type charuco"),
        (["--object", "board", "--corners", "9"], 2, "such as 9x6"),
        (["--object", "block"], 2, "known: corner, box, board"),
        (["--object", "board", "--paper", "A44"], 1, "did you mean 'A4'"),
        (["--object", "board", "--margin", "wide"], 1, "write it like 30mm"),
        (["--object", "board", "--square", "1km"], 1, "write it like 30mm"),
        (["--object", "box", "--square", "0.3mm"], 1, "more than 250 corners along a side"),
        (["--object", "board", "--square", "30mm", "--corners", "19x12"], 1, "larger paper"),
        ([SAMPLE / "target.yaml", "--paper", "A5"], 1, "does not fit on one page of A5"),
        (["none.yaml"], 1, "none.yaml"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    run: Run, tmp_path: Path, args: list[str], code: int, said: str
) -> None:
    result = run("target", "print", *args, "-o", tmp_path / "out", code=code)
    assert said in result.stderr
    assert result.stdout == ""
    if code == 1:
        assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_points_are_not_printed_and_unknown_units_refused(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "target.yaml"
    dots = "- {name: dots, type: points, points: [[0, 0, 1], [1, 0, 1]]}\n"
    board = "- {name: a, type: checkerboard, corners: [5, 4], square: 20, origin: [0, 0, 0], "
    board += "x_axis: [1, 0, 0], y_axis: [0, 1, 0]}\n"
    path.write_text(f"units: mm\nboards:\n{board}{dots}")
    assert "dots" not in run("target", "print", path, "-o", tmp_path / "out").stdout
    path.write_text(f"units: mm\nboards:\n{dots}")
    said = run("target", "print", path, "-o", tmp_path / "dots", code=1).stderr
    assert "lists of points only, which have no print" in said
    path.write_text(f"units: squares\nboards:\n{board}")
    said = run("target", "print", path, "-o", tmp_path / "cubits", code=1).stderr
    assert "units 'squares' cannot be printed" in said


@pytest.mark.slow
def test_odd_names_print(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "target.yaml"
    path.write_text(
        "units: mm\nboards:\n- {name: '$x_1$ \\\\ <日本> ' , type: checkerboard, "
        "corners: [5, 4], square: 20}\n".replace("> '", ">'")
    )
    run("target", "print", path, "-o", tmp_path / "out")
    if shutil.which("pdftotext"):
        pdf = tmp_path / "out" / "boards.pdf"
        text = subprocess.run(
            ["pdftotext", pdf, "-"], capture_output=True, text=True, check=True
        ).stdout
        assert "$x_1$" in text
        assert "print at 100 %, no scaling" in text
        assert "5 x 4 inner corners, squares 20 mm" in text


def test_without_the_library_it_says_how_to_get_it(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extra, "missing", lambda libraries: list(libraries))
    said = run("target", "print", "--object", "corner", "-o", tmp_path / "a", code=1).stderr
    assert said == "Error: printing needs matplotlib: pip install 'cubicfish[report]'\n"


@pytest.mark.slow
def test_an_ambiguous_board_is_warned_of(run: Run, tmp_path: Path) -> None:
    args = ["target", "print", "--object", "board", "--corners"]
    assert "looks the same" in run(*args, "8x6", "-o", tmp_path / "a").stderr
    assert "looks the same" not in run(*args, "9x6", "-o", tmp_path / "b").stderr


@pytest.mark.slow
def test_boards_much_smaller_than_the_paper_print(run: Run, tmp_path: Path) -> None:
    run("target", "print", "--object", "board", "--corners", "9x6", "--square", "10mm",
        "--paper", "A5", "-o", tmp_path)  # fmt: skip
    assert (tmp_path / "boards.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="stands for a full disk")
def test_a_full_disk_is_said_to_be_one() -> None:
    from cubicfish_cli.extensions.printing.drawing import write_boards

    _, pages = design(PrintOptions(kind="board"), paper("A4"), margin=MARGIN)
    with pytest.raises(OSError, match="No space left"):
        write_boards(Path("/dev/full"), pages)


def test_help_is_quick_and_has_an_example(run: Run) -> None:
    assert heavy_modules_after("target", "print", "-h") == "loaded:"
    shown = run("target", "print", "-h").output
    assert "cubicfish target print --object corner" in shown.split("Examples:")[1]


VIEWS = (
    ((150, 160, 140), (20, 25, 15), 0),
    ((120, 110, 120), (130, 40, 10), 80),
    ((120, 160, 115), (130, -40, 110), 170),
)


@pytest.mark.slow
def test_from_nothing_to_the_true_lens(run: Run, tmp_path: Path) -> None:
    run("target", "print", "--object", "corner", "-o", tmp_path / "mine", "-q")
    target_file = tmp_path / "mine" / "target.yaml"
    target = Target.load(target_file)
    (tmp_path / "photos").mkdir()
    for number, (eye, aim, roll) in enumerate(VIEWS):
        photo = render(
            target,
            TRUE_LENS.unproject,
            look_at(eye, aim, roll=np.radians(roll)),
            IMAGE_SIZE,
            supersample=2,
            noise=1.0,
            seed=number,
        )
        cv2.imwrite(str(tmp_path / "photos" / f"{number}.png"), photo)
    run(
        "calibrate", tmp_path / "photos", "--target", target_file, "-o", tmp_path / "calibration",
        "--no-hold-out", "--no-report", "--refine-target", "off", "--jobs", "1",
    )  # fmt: skip
    camera = load_camera(tmp_path / "calibration" / "camera.yaml").camera
    rays = rays_in_cone(min(80.0, camera.max_angle_deg), 2000)
    miss, _ = aligned_difference(camera, TRUE_LENS, rays)
    assert camera.max_angle_deg > 90
    assert np.hypot(*miss.T).max() < 0.3
