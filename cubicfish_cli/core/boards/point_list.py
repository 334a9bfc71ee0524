"""A list of world points, whose corners another program finds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.boards.board import Board, Face
from cubicfish_cli.core.boards.section import Section, is_point
from cubicfish_cli.core.boards.shape import BoardShape, read_shape
from cubicfish_cli.core.errors import TargetError
from cubicfish_cli.core.types import FloatArray, IntArray

_FLAT = 1e-6


class PointList(Board):
    """Points at any place: ``columns`` of them, in one row."""

    kind = "points"
    keys = ("points", "offsets")

    @classmethod
    def read(cls, section: Section, name: str, *, alone: bool) -> Board:
        """As :meth:`Board.read`; points have their places in themselves."""
        value = section.required("points", hint="a list of [x, y, z]")
        if not isinstance(value, list) or len(value) < 2:
            section.refuse("points", "must be a list of at least two points, each [x, y, z]")
        for index, point in enumerate(value):
            if not is_point(point):
                section.refuse("points", f"point {index} must be three finite numbers, [x, y, z]")
        points = np.array(value, float)
        order = np.lexsort(points.T)
        twins = np.flatnonzero((np.diff(points[order], axis=0) == 0).all(axis=1))
        if twins.size:
            a, b = sorted(order[twins[0] : twins[0] + 2])
            section.refuse("points", f"points {a} and {b} are in the same place")
        return cls(
            name=name,
            columns=len(points),
            rows=1,
            square=0.0,
            origin=np.zeros(3),
            x_axis=np.array([1.0, 0.0, 0.0]),
            y_axis=np.array([0.0, 1.0, 0.0]),
            points=points,
            shape=read_shape(section, len(points), 1),
        )

    @property
    def _points(self) -> FloatArray:
        assert self.points is not None
        return self.points

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        return {"points": self._points.tolist()}

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """Zeros: there is no plane."""
        return np.zeros((*np.broadcast_shapes(np.shape(column), np.shape(row)), 2))

    def printed_face(self, margin: float) -> Face:
        """None: :class:`TargetError`."""
        raise TargetError(f"board {self.name!r}: a points board cannot be drawn: change its type")

    def dark_squares(self) -> FloatArray:
        """None of them."""
        return np.empty((0, 4, 2))

    def in_mirror(self) -> Self:
        """As :meth:`Board.in_mirror`; a point keeps its number."""
        mirror = np.array([1.0, 1.0, -1.0])
        shape = self.shape and replace(self.shape, offsets=self.shape.offsets * mirror)
        return replace(self, points=self._points * mirror, shape=shape, mirrored=not self.mirrored)

    def moved(self, offset: FloatArray) -> Self:
        """As :meth:`Board.moved`."""
        return replace(self, origin=self.origin + offset, points=self._points + offset)

    def outline(self) -> FloatArray:
        """All points."""
        return self._points

    def plane(self) -> tuple[FloatArray, FloatArray] | None:
        """As :meth:`Board.plane`, for points in one plane to a millionth of their extent."""
        middle = self._points.mean(axis=0)
        _, extents, axes = np.linalg.svd(self._points - middle, full_matrices=True)
        if len(extents) == 3 and extents[2] > _FLAT * extents[0]:
            return None
        return middle, axes[2]

    def _drawn_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        return self._points[np.asarray(column, int)]

    def _deformation(self, shape: BoardShape, column: IntArray, row: IntArray) -> FloatArray:
        return np.asarray(shape.offsets[row, column] @ self.axes)
