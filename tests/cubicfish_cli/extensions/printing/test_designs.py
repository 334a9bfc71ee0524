"""Boards that are made for a size of paper."""

import pytest

from cubicfish import Target
from cubicfish.scene.faces import board_face
from cubicfish_cli.extensions.printing.command import _TYPES
from cubicfish_cli.extensions.printing.designs import DESIGNS


@pytest.mark.parametrize("made", DESIGNS.values(), ids=DESIGNS)
def test_a_designed_board_is_as_long_as_it_says_and_reads_back(made):
    counts, square = (made.counts[0] + 1, made.counts[0]), 20.0
    family = made.family(None, made.marker_count(counts))
    record = {"name": "floor", **made.record(counts, square, family, 3)}
    (board,) = Target.from_data({"units": "mm", "boards": [record]}).boards
    face = board_face(board, margin=0.0)
    for axis, count in enumerate(counts):
        length = made.length(count, square)
        assert face.upper[axis] - face.lower[axis] == pytest.approx(length)
        assert made.count(length, square) == count
        assert made.count(length - 1e-3, square) == count - 1
    assert board.kind == made.type
    assert len(board.marker_cells()) == made.marker_count(counts)
    assert board.markers is None or board.markers.first == 3


def test_the_command_offers_every_design():
    assert tuple(DESIGNS) == _TYPES
