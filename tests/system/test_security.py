"""What SECURITY.md states is what the code states."""

import re
from pathlib import Path

import pytest

from cubicfish.files import reading
from cubicfish.photos import photos

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "SECURITY.md").read_text(encoding="utf-8")


def stated() -> list[list[str]]:
    """The bounds in SECURITY.md, without the head."""
    table = TEXT.split("| file | largest |")[1].split("\n\n")[0]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in table.splitlines()[2:]]


def coded() -> list[list[str]]:
    """The bounds in the reading module, whose cells go over several lines."""
    _, _, body, _ = re.split(r"^=[= ]+=$", str(reading.__doc__), flags=re.MULTILINE)
    ends = [match.span() for match in re.finditer("=+", _ruler())]
    rows: list[list[str]] = []
    for line in body.strip("\n").splitlines():
        cells = [line[start : end + 2].strip() for start, end in ends]
        if cells[0]:
            rows.append(cells)
        else:
            rows[-1] = [f"{one} {more}".strip() for one, more in zip(rows[-1], cells, strict=True)]
    return rows


def _ruler() -> str:
    return next(line for line in str(reading.__doc__).splitlines() if line.startswith("==="))


def test_the_bounds_are_those_of_the_code() -> None:
    assert stated() == coded()
    assert len(stated()) >= 10


def test_the_bound_of_pictures_is_the_one_that_is_kept() -> None:
    (claim,) = re.findall(r"more than ([0-9]+) million pixels", TEXT)
    assert int(claim) * 1_000_000 == photos.MAX_PIXELS


@pytest.mark.parametrize("path", re.findall(r"`((?:tests|benchmarks)/[\w/.]+)", TEXT))
def test_the_commands_that_make_the_figures_exist(path: str) -> None:
    assert (ROOT / path).exists()


def test_figures_are_there() -> None:
    assert "@" not in TEXT
