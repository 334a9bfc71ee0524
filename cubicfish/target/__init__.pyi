"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.target.boards.board import Board as Board
from cubicfish.target.boards.markers import Markers as Markers
from cubicfish.target.boards.types import BOARD_TYPES as BOARD_TYPES
from cubicfish.units import MILLIMETRES as MILLIMETRES
