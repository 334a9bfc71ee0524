"""Set-ups that are wrong in one known way, through ``cubicfish calibrate``: it names the cause.

``benchmarks/wrong_setups.py`` does the same with all cases and many seeds. Here each kind comes
once, and from the one of its first ten seeds that makes the fewest corners, to be quick.
"""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import wrong_setups as wrong
from running import Run
from samples import SAMPLE

from cubicfish import load_camera
from cubicfish_cli.words.sentences import render

pytestmark = pytest.mark.slow

# Its corners fit no lens at all.
REFUSED = ("[7, 9] for [9, 7], one board",)
# Name of the case, and the seed. All of these come through corners.csv.
FROM_CORNERS = [
    ("[7, 9] for [9, 7], one board", 2),
    ("all photos mirrored, flat board", 5),
    ("some photos mirrored", 0),
    ("squares counted", 9),
    ("square 1 % off, one board", 4),
    ("a board 2 mm off", 9),
    ("columns run backwards, one board", 300),
    ("a board turned by 1°", 7),
    ("a board turned by 1°", 301),
    ("two cameras, focal length x 1.1", 2),
    ("zoom x 1.05 half-way, flat board", 5),
    ("lens bumped, 5 px half-way", 4),
    ("lens bumped, 5 px half-way", 600),
    ("5 poses, 3 photos each", 2),
    ("half a pixel off (cannot be seen)", 0),
    ("one grid one column off", 2),
    ("all from one place, flat board", 9),
    ("one photo mirrored among ten, flat board", 1),
    ("a size 1.5 times too large", 2),
]


def case_of(name: str) -> tuple[int, wrong.Case]:
    return next((i, case) for i, case in enumerate(wrong.CASES) if case.name == name)


def calibrated(run: Run, arguments: list[object], code: int) -> tuple[str, dict]:
    """What is said on stderr, and the record: {} where the fit was refused."""
    done = run(*arguments, "--no-hold-out", "--json", code=code)
    lines = [line for line in done.stderr.splitlines() if not line.startswith(("Fitting", "Look"))]
    return "\n".join(lines), {} if code else json.loads(done.stdout)


@pytest.mark.parametrize(("name", "seed"), FROM_CORNERS)
def test_the_cause_is_named(run: Run, tmp_path: Path, name: str, seed: int) -> None:
    number, case = next((i, one) for i, one in enumerate(wrong.CASES) if one.name == name)
    setup = case.make(np.random.default_rng([number, seed]))
    said, record = calibrated(run, setup.save(tmp_path), int(name in REFUSED))
    expected = (*case.says, *setup.says)
    for pattern in expected:
        assert re.search(pattern, said), said
    assert bool(said) == bool(expected), said
    if name in REFUSED:
        assert len(said.splitlines()) == 1
    elif expected:
        # One cause, which the camera's file and the verdict know of too.
        (finding,) = record["findings"]
        kept = load_camera(tmp_path / "calibration" / "camera.yaml").fit
        assert [render(one).what for one in kept.findings] == [finding["what"]]
        reasons = [reason["why"] for reason in record["verdict"]["reasons"]]
        assert (finding["level"] == "note") != any(finding["what"] in why for why in reasons)


# Right set-ups, of which nothing may be claimed, hard as they are


@pytest.mark.parametrize("case", wrong.HARD, ids=lambda case: case.name)
def test_nothing_is_claimed_of_a_right_set_up(run: Run, tmp_path: Path, case: wrong.Case) -> None:
    setup = case.make(np.random.default_rng(1))
    said, record = calibrated(run, setup.save(tmp_path), 0)
    assert record["findings"] == [], said


@pytest.mark.parametrize(("kind", "refined"), [(927, "shape"), (706, "off")])
def test_a_camera_of_few_photos_does_not_judge_single_ones(
    run: Run, tmp_path: Path, kind: int, refined: str
) -> None:
    """Five photos: a camera of four of them is off by itself in the fifth."""
    setup = wrong.good(np.random.default_rng([99, kind]), kind)
    done = run(*setup.save(tmp_path), "--refine-target", refined, "--no-hold-out", "--json")
    assert json.loads(done.stdout)["findings"] == []


# Wrong set-ups that come as photos: four of the sample's


@pytest.fixture(scope="module")
def photos() -> dict[str, np.ndarray]:
    paths = sorted((SAMPLE / "photos").iterdir())[:4]
    return {path.stem: cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths}


def from_photos(
    run: Run, folder: Path, photos: dict[str, np.ndarray], code: int, **changed: str
) -> tuple[str, dict]:
    """Calibrate with pictures, and the sample's target with some text of it changed."""
    (folder / "photos").mkdir()
    for name, picture in photos.items():
        cv2.imwrite(str(folder / "photos" / f"{name}.png"), picture)
    text = (SAMPLE / "target.yaml").read_text(encoding="utf-8")
    for old, new in changed.items():
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "target.yaml").write_text(text, encoding="utf-8")
    out = folder / "calibration"
    arguments = ["calibrate", folder / "photos", "-t", folder / "target.yaml", "-o", out, "-j", 1]
    return calibrated(run, arguments, code)


def test_right_photos(run: Run, tmp_path: Path, photos: dict[str, np.ndarray]) -> None:
    said, record = from_photos(run, tmp_path, photos, 0)
    assert record["findings"] == [], said


def test_photos_that_are_all_mirrored(
    run: Run, tmp_path: Path, photos: dict[str, np.ndarray]
) -> None:
    mirrored = {name: picture[:, ::-1] for name, picture in photos.items()}
    said, _ = from_photos(run, tmp_path, mirrored, 1)
    assert "all photos are mirrored" in said


def test_one_photo_that_is_mirrored(
    run: Run, tmp_path: Path, photos: dict[str, np.ndarray]
) -> None:
    one = {name: p[:, ::-1] if name == "corner_02" else p for name, p in photos.items()}
    said, record = from_photos(run, tmp_path, one, 0)
    assert [finding["cause"] for finding in record["findings"]] == ["mirrored"]
    assert "warning: corner_02.png is mirrored (" in said


def test_rows_and_columns_exchanged_in_the_drawing(
    run: Run, tmp_path: Path, photos: dict[str, np.ndarray]
) -> None:
    said, record = from_photos(run, tmp_path, photos, 0, **{"[9, 6]": "[6, 9]"})
    assert [finding["cause"] for finding in record["findings"]] == ["board_order"]
    assert "board floor: rows and columns are swapped: corners: [6, 9] for [9, 6]" in said


@pytest.mark.parametrize("drawn", ["[10, 6]", "[9, 7]", "[8, 6]"])
def test_a_line_of_corners_too_many_or_too_few_in_the_drawing(
    run: Run,
    tmp_path: Path,
    photos: dict[str, np.ndarray],
    drawn: str,
) -> None:
    said, record = from_photos(run, tmp_path, photos, 0, **{"[9, 6]": drawn})
    (finding,) = record["findings"]
    assert (finding["cause"], finding["boards"]) == ("corner_count", ["floor"])
    columns, rows = drawn[1:-1].split(", ")
    assert re.search(
        rf"warning: board floor: the target says {columns}x{rows} inner corners, "
        "(all 4|[23] of 4) photos show 9x6",
        said,
    ), said
    assert record["verdict"]["level"] == "care"


def test_the_target_of_another_object(
    run: Run, tmp_path: Path, photos: dict[str, np.ndarray]
) -> None:
    changed = {"[9, 6]": "[12, 9]", "[8, 7]": "[13, 10]", "[7, 5]": "[12, 11]"}
    changed |= {"[0, 37.5, 187.5]": "[-90, 0, 250]", "[187.5, 0, 137.5]": "[300, 120, 300]"}
    two = {name: photos[name] for name in sorted(photos)[:2]}
    said, _ = from_photos(run, tmp_path, two, 1, **changed)
    assert said.startswith("Error: 2 photos show grids of 9x6 (in 2) and 7x5 (in 2) inner corners")
    assert "boards of another size (floor 12x9, left 13x10, right 12x11): give the target" in said


def test_one_photo_under_several_names(
    run: Run, tmp_path: Path, photos: dict[str, np.ndarray]
) -> None:
    """Rolling copies, each a little brighter than the last."""
    copies = {
        f"corner_01_copy = {number}": cv2.convertScaleAbs(
            photos["corner_01"], alpha=1 + 0.03 * number
        )
        for number in range(3)
    }
    said, record = from_photos(run, tmp_path, photos | copies, 0)
    (repeats,) = record["findings"]
    assert repeats["cause"] == "repeats"
    names = {"corner_01.png", *(f"{name}.png" for name in copies)}
    assert set(repeats["images"]) == names
    assert "corner_01_copy = 0.png is a near-duplicate of corner_01.png" in said
    assert ["corner_01.png", "corner_01_copy = 0.png"] in repeats["figures"]["repeats"]
