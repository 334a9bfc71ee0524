"""Pictures of a target that nobody knows, and of one that is known, at a glance and in full."""

from pathlib import Path

import numpy as np
from synthetic import checkerboard

from cubicfish.observe.detection import detect
from cubicfish.observe.glances import Glances
from cubicfish.photos.photos import Photo
from cubicfish.run import Run
from cubicfish.target.target import Target
from cubicfish.workers.pool import Work

BOARD = checkerboard("board", 7, 5, 30.0)
SIZE = (480, 360)


def photo(name: str, shift: int | None) -> Photo:
    """A board of 8 x 6 squares of 30 px, so far to the right; or none."""
    picture = np.full(SIZE[::-1], 200, np.uint8)
    if shift is not None:
        dark = np.indices((6, 8)).sum(axis=0) % 2 == 0
        squares = np.kron(np.where(dark, 40, 200), np.ones((30, 30)))
        picture[80:260, 60 + shift : 300 + shift] = squares
    return Photo(name=name, path=Path(name), picture=picture)


PHOTOS = [photo("a", 0), photo("empty", None), photo("b", 40)]


def test_grids_without_a_target_are_in_the_reports() -> None:
    glances = Glances(photos=PHOTOS, size=SIZE)
    seen = glances.look(range(3), (), Work(jobs=1))
    full = detect(PHOTOS, (), Run(jobs=1), again=False)
    for detection in (seen, full):
        assert len(detection.corners.pixel) == 0
        assert [report.name for report in detection.photos] == ["a", "empty", "b"]
        found = [report.found.grids for report in detection.photos]
        assert [[len(grid) for grid in own] for own in found] == [[35], [], [35]]
    assert [glances.shows(number) for number in range(3)] == [True, False, True]
    assert glances.any_seen


def test_a_known_target_has_its_corners_named() -> None:
    glances = Glances(photos=PHOTOS, size=SIZE)
    assert not glances.any_seen
    target = Target(units="mm", boards=(BOARD,))
    seen = glances.look([0, 2], [target], Work(jobs=1))
    assert seen.corners.images == ("a", "b")
    assert seen.corners.target is target
    assert [(one.name, one.corners, one.boards) for one in seen.photos] == [
        ("a", 35, ("board",)),
        ("b", 35, ("board",)),
    ]
    assert not glances.shows(1)  # nobody looked
