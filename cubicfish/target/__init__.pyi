"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.target.boards.board import Board as Board
from cubicfish.units import MILLIMETRES as MILLIMETRES
