"""Views in space of the target and the photos' places."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cubicfish import FloatArray
from cubicfish.solve import Poses
from cubicfish_cli.inputs.calibration_facts import Facts
from cubicfish_cli.render.pages import figures as page
from cubicfish_cli.render.pages.plot import INK, Space

# Size of a drawn camera, as a share of all that is drawn.
_CAMERA = 0.06
_MOST_POINTS, _MOST_CAMERAS = 1000, 1000  # of a scene that turns, and is drawn many times
_VIEWS = (
    ("scene-side", "Where the photos were taken from", 25, -50),
    ("scene-top", "The same from above", 89.9, -90),
)
"""Name, title, elevation and azimuth, degrees."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scene:
    """What is drawn, turned upright.

    Attributes:
        plates: (outline (K, 3), colour) of each board that has squares.
        points: (N, 3) of each other board, or of pairs.
        centre, rotation: (P, 3) and (P, 3, 3) of the photos.

    """

    plates: Sequence[tuple[FloatArray, str]]
    points: Sequence[FloatArray]
    centre: FloatArray
    rotation: FloatArray

    @property
    def everything(self) -> FloatArray:
        """All of it, (N, 3)."""
        plates = [plate for plate, _ in self.plates]
        return np.concatenate([*plates, *self.points, self.centre])

    def as_record(self, images: Sequence[str]) -> dict[str, Any]:
        """Return what the page's script draws, in shares of the scene's size about its middle."""
        low, high = self.everything.min(axis=0), self.everything.max(axis=0)
        size = float((high - low).max() or 1.0)

        def near(points: FloatArray) -> list[list[float]]:
            return [
                [round(x, 4) for x in row] for row in ((points - (low + high) / 2) / size).tolist()
            ]

        cameras = page.some(len(self.centre), _MOST_CAMERAS).tolist()
        strokes = page.camera_strokes(self.centre, self.rotation, _CAMERA * size)
        return {
            "plates": [[colour, near(plate)] for plate, colour in self.plates],
            "points": [near(one[page.some(len(one), _MOST_POINTS)]) for one in self.points],
            "cameras": [[images[one], near(strokes[one])] for one in cameras],
        }

    def drawn(self, elevation: float, azimuth: float) -> Space:
        """Draw it from a side."""
        space = Space(self.everything, elevation, azimuth)
        for plate, colour in sorted(self.plates, key=lambda one: space.depth(one[0])):
            space.area(plate, colour, 0.3)
        for points in self.points:
            space.dots(points[page.some(len(points), page.MOST_DOTS // 4)], page.BLUE, 2.0)
        size = _CAMERA * float(np.ptp(self.everything, axis=0).max() or 1.0)
        page.draw_cameras(space, self.centre, self.rotation, size, [INK] * len(self.centre))
        return space


def _make_scene(facts: Facts, poses: Poses, colours: Sequence[str]) -> _Scene:
    """Gather what is drawn; boards have a colour each."""
    rotation = poses.rotation
    centre = -np.einsum("nij,ni->nj", rotation, poses.translation)
    boards = () if facts.target is None else facts.target.boards
    # A fit and its file differ in the last digits, but the page must be the same.
    outlines = [board.outline().astype(np.float32).astype(float) for board in boards]
    of_boards = list(zip(boards, outlines, colours, strict=True))
    plates = [(plate, colour) for board, plate, colour in of_boards if board.points is None]
    loose = [plate for board, plate, _ in of_boards if board.points is not None]
    if not boards and facts.errors is not None:
        loose = [facts.errors.pairs.world]
    middle = np.concatenate([*outlines, *loose, centre]).mean(axis=0)
    turn = page.upright((middle - centre).mean(axis=0), -rotation[:, 1].mean(axis=0))
    return _Scene(
        plates=[(plate @ turn.T, colour) for plate, colour in plates],
        points=[points @ turn.T for points in loose],
        centre=centre @ turn.T,
        rotation=rotation @ turn.T,
    )


def scene_figures(facts: Facts) -> tuple[dict[str, page.Drawn], dict[str, Any] | None]:
    """Draw the target with the photos' places from two sides; none if no pose is known.

    Returns:
        The figures by their names, and what the page's script draws from all sides.

    """
    poses = Poses.of_photos(facts.fit.poses, [*facts.fit.poses])
    if poses is None:
        return {}, None
    boards = () if facts.target is None else facts.target.boards
    told_apart = len(boards) <= len(page.BOARD_COLOURS)
    colours = page.BOARD_COLOURS[: len(boards)] if told_apart else (page.BLUE,) * len(boards)
    scene = _make_scene(facts, poses, colours)
    keys = [
        page.Key(kind="area", colour=colour, text=board.name)
        for board, colour in zip(boards * told_apart, colours, strict=False)
    ]
    count = len(scene.centre)
    drawn = {
        name: page.finished(
            scene.drawn(elevation, azimuth),
            name=name,
            title=title,
            label=f"{len(boards)} boards and {count} camera poses",
            caption=f"{count:,} photo{'s' * (count != 1)}; lengths are in "
            f"{facts.units or 'the units of the target'}.",
            keys=(
                *keys,
                page.Key(
                    kind="line", colour=INK, text="a photo: the open side looks at the target"
                ),
            ),
        )
        for name, title, elevation, azimuth in _VIEWS
    }
    return drawn, scene.as_record([*facts.fit.poses])
