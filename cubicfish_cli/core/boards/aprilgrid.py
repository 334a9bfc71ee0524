"""AprilGrid: a grid of tags with small black squares between them.

The layout is Kalibr's (``kalibr_create_target_pdf --type apriltag``): tags stand upright as
AprilTag draws them, with a black frame of two modules; ids run along x and then upwards, so the
first one is at the bottom left; black squares as wide as the gaps touch the tags' corners, which
makes each tag corner an X-corner. Kalibr's board has its origin at the bottom left corner and y
up; here corner (0, 0) is the top left one and rows grow downwards, as on all boards. Kalibr's
point at column c and row r (from the bottom) is corner (c, rows - 1 - r) here.
"""

from __future__ import annotations

from math import floor
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.boards.board import AROUND_SQUARE, Board, Face
from cubicfish_cli.core.boards.markers import (
    TAG_FAMILIES,
    known_family,
    marker_ink,
    marker_modules,
    read_markers,
    table_ink,
)
from cubicfish_cli.core.boards.section import Section
from cubicfish_cli.core.boards.shape import PLACE_KEYS, SHAPE_KEYS, read_place, read_shape
from cubicfish_cli.core.errors import TargetError
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray


class AprilGrid(Board):
    """A grid of tags, each with four corners."""

    kind = "aprilgrid"
    keys = ("tags", "tag", "spacing", "family", "first_marker", *PLACE_KEYS, *SHAPE_KEYS)
    per_cell = 2
    # A tag's frame is not in the target file: other programs print one module.
    marker_borders = (2, 1)
    designed_counts = (2, 6)
    designed_spacing = 0.3  # as Kalibr's own boards have it

    @classmethod
    def read(cls, section: Section, name: str, *, alone: bool) -> Board:
        """As :meth:`Board.read`."""
        origin, x_axis, y_axis = read_place(section, alone=alone)
        columns, rows = section.counts("tags", "tags along x and along y")
        side = section.length("tag", hint="the side of a tag, black border included")
        spacing = section.length("spacing", hint="gap between tags divided by the side of a tag")
        family = "tag36h11"
        if "family" in section.data:
            family = section.choice("family", TAG_FAMILIES, hint="such as tag36h11")
        return cls(
            name=name,
            columns=2 * columns,
            rows=2 * rows,
            square=side,
            origin=origin,
            x_axis=x_axis,
            y_axis=y_axis,
            markers=read_markers(section, TAG_FAMILIES[family], side, columns * rows),
            spacing=spacing,
            shape=read_shape(section, 2 * columns, 2 * rows),
        )

    @classmethod
    def designed_marker_count(cls, counts: tuple[int, int]) -> int:
        """As :meth:`Board.designed_marker_count`."""
        return counts[0] * counts[1]

    @classmethod
    def designed_length(cls, count: int, square: float) -> float:
        """As :meth:`Board.designed_length`."""
        return square * (count * (1 + cls.designed_spacing) + cls.designed_spacing)

    @classmethod
    def designed_count(cls, length: float, square: float) -> int:
        """As :meth:`Board.designed_count`."""
        gap = cls.designed_spacing
        return floor((length / square - gap) / (1 + gap) + 1e-9)

    @classmethod
    def designed_family(cls, asked: str | None, count: int) -> str:
        """As :meth:`Board.designed_family`, also by the name that AprilTag has for it."""
        name = TAG_FAMILIES.get(asked or "tag36h11", asked or "")
        known = (*TAG_FAMILIES, *TAG_FAMILIES.values())
        return known_family(cls.kind, name, TAG_FAMILIES.values(), known, count)

    @property
    def family(self) -> str:
        """Name of the tags' family, as AprilTag spells it."""
        dictionary = self.markers.dictionary if self.markers else None
        return next((tag for tag, name in TAG_FAMILIES.items() if name == dictionary), "")

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        return {
            "tags": [self.columns // 2, self.rows // 2],
            "tag": self.square,
            "spacing": self.spacing,
            "family": self.family,
            "first_marker": self.markers.first if self.markers else 0,
        }

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """As :meth:`Board.plane_points`."""
        column, row = np.broadcast_arrays(np.asarray(column, float), np.asarray(row, float))
        return np.stack([self._tag_offset(column), self._tag_offset(row)], axis=-1)

    def printed_cells(self) -> IntArray:
        """As :meth:`Board.printed_cells`."""
        if self.markers is None:
            return super().printed_cells()
        row, column = np.divmod(np.arange(self.markers.count), self.columns // 2)
        row = self.rows // 2 - 1 - row
        return np.stack([self.markers.first + np.arange(self.markers.count), column, row], axis=-1)

    def printed_face(self, margin: float) -> Face:
        """As :meth:`Board.printed_face`; the outer black squares have ``margin`` tags of paper."""
        markers = self.markers
        if markers is None:
            raise TargetError(f"board {self.name!r} has no markers: it cannot be drawn")
        border = self.marker_borders[0]
        ids, column, row = self.marker_cells().T
        # OpenCV keeps these families upside down.
        ink = marker_ink(markers, ids, border)[:, ::-1, ::-1]
        size = marker_modules(markers, border)
        columns, rows = self.columns // 2, self.rows // 2
        table = np.zeros((rows, columns, size, size), bool)
        table[row, column] = ink
        pitch = self.square * (1 + self.spacing)
        gap = self.square * self.spacing

        def is_dark(plane: FloatArray) -> BoolArray:
            # Gaps lie before each tag; one more gap follows the last.
            cell = np.floor((plane + gap) / pitch).astype(np.int32)
            within = plane - cell * pitch
            in_gap = np.less(within, 0)
            printed: BoolArray = np.all((cell >= 0) & (cell <= (columns, rows)), axis=-1)
            square: BoolArray = in_gap.all(axis=-1) & printed
            tag: BoolArray = printed & ~in_gap.any(axis=-1) & (cell < (columns, rows)).all(axis=-1)
            module = np.floor(within / self.square * size).astype(np.int32)
            return square | table_ink(table, cell, module, tag)

        modules = np.arange(size + 1) / size * self.square
        x, y = (
            np.unique(
                np.concatenate(
                    [
                        [-gap],
                        (np.arange(tags)[:, None] * pitch + modules).ravel(),
                        [tags * pitch],
                    ]
                )
            )
            for tags in (columns, rows)
        )
        reach = (self.spacing + margin) * self.square
        far_x, far_y = self.plane_points(self.columns - 1, self.rows - 1)
        return Face(
            lower=(-reach, -reach),
            upper=(float(far_x) + reach, float(far_y) + reach),
            is_dark=is_dark,
            steps=(x, y),
        )

    def dark_squares(self) -> FloatArray:
        """As :meth:`Board.dark_squares`."""
        row, column = np.indices((self.rows // 2, self.columns // 2)).reshape(2, -1)
        corner = 2 * np.stack([column, row], axis=-1)[:, None] + AROUND_SQUARE
        return self.plane_points(corner[..., 0], corner[..., 1])

    def _tag_offset(self, index: FloatArray) -> FloatArray:
        tag = np.floor(index / 2)
        return self.square * (tag * (1 + self.spacing) + (index - 2 * tag))
