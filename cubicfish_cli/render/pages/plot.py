"""Plots as text of SVG: axes, marks on them, and a box in space.

A plotting library takes longer to load than a whole page to be made, and what a page shows is
simple. Lengths are units of the drawing, of which its width has `WIDTH`.
"""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from typing import Any

import cv2
import numpy as np

from cubicfish import FloatArray

INK, MUTED, GRID = "#1d2329", "#57606a", "#dfe3e8"
WIDTH = 360.0
_LEFT, _BESIDE, _RIGHT, _TOP = 34.0, 48.0, 12.0, 8.0
_HIGHEST = 260.0
"""Of a plot whose shape is that of what it shows."""
_LETTER, _ROOM, _TICK = 10.0, 34.0, 4.0
_BAR, _BAR_STEPS = 9.0, 256
# What lies farther off is not seen, and must not become a number that no program reads.
_FAR = 1e4

Range = tuple[float, float]


class Plot:
    """Axes, and marks on them; what reaches beyond them is cut off.

    Args:
        x: what the left and the right end stand for.
        y: what the bottom and the top stand for.
        box: left, top, width and height in the drawing.
        grid: whether lines go on from the ticks, and only two sides are drawn.
        labels: below and beside; None writes no figures there either.

    """

    def __init__(
        self,
        x: Range,
        y: Range,
        box: Sequence[float],
        *,
        grid: bool = False,
        labels: tuple[str | None, str | None] = ("", ""),
    ) -> None:
        self._low, high = np.array([x[0], y[0]]), np.array([x[1], y[1]])
        self._span = np.where(high == self._low, 1.0, high - self._low)
        self.left, self.top, self.width, self.height = box
        self._marks: list[str] = []
        self._axes: list[str] = []
        self._draw_axes(x, y, grid=grid, labels=labels)

    @property
    def bottom(self) -> float:
        """Where the room for its figures and its label ends."""
        return self.top + self.height + _ROOM

    def place(self, points: Any) -> FloatArray:
        """Where points (..., 2) lie in the drawing."""
        with np.errstate(over="ignore"):
            share = (np.asarray(points, float) - self._low) / self._span
            placed = [self.left, self.top + self.height] + share * [self.width, -self.height]
        return np.clip(placed, -_FAR, _FAR)

    def dots(self, points: Any, colour: str, size: float, opacity: float = 1.0) -> None:
        """Draw discs at (N, ...), as one line without length for each: thousands take no room."""
        at = self.place(points)
        line = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in at[np.isfinite(at).all(axis=1)].tolist())
        self._mark(line, f'stroke-linecap="round" {_stroke(colour, size, opacity)}')

    def lines(
        self, paths: Iterable[Any], colour: str, width: float = 1.0, *, dash: str = ""
    ) -> None:
        """Draw each of several paths (K, ...) of one colour."""
        more = f' stroke-dasharray="{dash}"' if dash else ""
        placed = self.place(paths) if isinstance(paths, np.ndarray) else map(self.place, paths)
        self._mark("".join(map(_path, placed)), _stroke(colour, width) + more)

    def area(self, outline: Any, colour: str, opacity: float = 1.0) -> None:
        """Fill an outline (K, ...)."""
        self.areas([outline], colour, opacity)

    def areas(self, outlines: Iterable[Any], colour: str, opacity: float = 1.0) -> None:
        """Fill outlines (K, ...), but for those with points that are nowhere, as one shape."""
        placed = [self.place(one) for one in outlines]
        line = "".join(_path(one) + "Z" for one in placed if np.isfinite(one).all())
        self._mark(line, f'fill="{colour}" fill-opacity="{opacity:g}"')

    def image(
        self, pixels: FloatArray, low: Sequence[float], high: Sequence[float], clip: Any = None
    ) -> None:
        """Lay a picture (H, W, 4) of red, green, blue and opacity, 0 to 1, over a rectangle.

        Args:
            pixels: the picture; its first row is at ``high`` y.
            low: x and y of its bottom left corner.
            high: of its top right corner.
            clip: outlines (K, 2) beyond which it is cut off, holes among them.

        """
        _, png = cv2.imencode(".png", np.rint(255 * pixels[..., [2, 1, 0, 3]]).astype(np.uint8))
        (left, bottom), (right, top) = self.place([low, high]).tolist()
        cut = ""
        if clip is not None:
            line = "".join(_path(self.place(one)) + "Z" for one in clip)
            self._marks.append(
                f'<clipPath id="clip"><path clip-rule="evenodd" d="{line}"/></clipPath>'
            )
            cut = ' clip-path="url(#clip)"'
        self._marks.append(
            f'<image x="{left:.2f}" y="{top:.2f}" width="{right - left:.2f}" '
            f'height="{bottom - top:.2f}" preserveAspectRatio="none" '
            f'style="image-rendering:pixelated"{cut} '
            f'href="data:image/png;base64,{b64encode(png.tobytes()).decode()}"/>'
        )

    def text(self, point: Any, words: str, shift: FloatArray | Sequence[float] = (0, 0)) -> None:
        """Write a word at a place (...,), moved by some units."""
        x, y = self.place(point) + shift
        self._marks.append(_write(x, y + 0.35 * _LETTER, words))

    def point_on(self) -> None:
        """Show by a tip at the right end that there is more."""
        half = self.height / 2
        tip = f"M{self.left + self.width:.1f} {self.top:.1f}l7 {half:g}l-7 {half:g}Z"
        self._axes.append(f'<path d="{tip}" fill="{MUTED}"/>')

    def drawn(self) -> str:
        """The plot as elements of SVG."""
        box = f"{self.left:.1f} {self.top:.1f} {self.width:.1f} {self.height:.1f}"
        x, y, width, height = box.split()
        cut = f'<svg x="{x}" y="{y}" width="{width}" height="{height}" viewBox="{box}">'
        return "".join([cut, *self._marks, "</svg>", *self._axes])

    def _draw_axes(
        self, x: Range, y: Range, *, grid: bool, labels: tuple[str | None, str | None]
    ) -> None:
        left, bottom = self.left, self.top + self.height
        right, middle = self.left + self.width, self.top + self.height / 2
        below, beside = labels
        lines, ticks = [], []
        for value, name in nice_ticks(*x, self.width / 30):
            at = float(self.place([value, y[0]])[0])
            lines.append(f"M{at:.1f} {bottom:.1f}V{self.top:.1f}")
            ticks.append(f"M{at:.1f} {bottom:.1f}v{_TICK}")
            if below is not None:
                self._axes.append(_write(at, bottom + _TICK + _LETTER, name))
        for value, name in nice_ticks(*y, self.height / 30) if beside is not None else ():
            at = float(self.place([x[0], value])[1])
            lines.append(f"M{left:.1f} {at:.1f}H{right:.1f}")
            ticks.append(f"M{left:.1f} {at:.1f}h-{_TICK}")
            self._axes.append(_write(left - _TICK - 2, at + 0.35 * _LETTER, name, "end"))
        if grid:
            self._mark("".join(lines), _stroke(GRID, 0.8))
        frame = f"M{left:.1f} {self.top:.1f}V{bottom:.1f}H{right:.1f}"
        frame += "" if grid else f"V{self.top:.1f}Z"
        self._axes.append(f'<path d="{frame}{"".join(ticks)}" {_stroke(MUTED, 0.8)}/>')
        if below:
            self._axes.append(_write((left + right) / 2, bottom + 2.9 * _LETTER, below))
        if beside:
            turned = f' transform="rotate(-90 {_LETTER:g} {middle:.1f})"'
            self._axes.append(_write(_LETTER, middle, beside, more=turned))

    def _mark(self, line: str, look: str) -> None:
        if line.strip("MZ"):
            self._marks.append(f'<path d="{line}" {look}/>')


class Space(Plot):
    """A box in space, seen from far away: points are (..., 3), and z is up.

    Args:
        points: (N, 3) what it holds.
        elevation: from how high it is seen, degrees above its floor.
        azimuth: from which side, degrees.

    """

    def __init__(self, points: FloatArray, elevation: float, azimuth: float) -> None:
        up, around = np.deg2rad([elevation, azimuth])
        sine, cosine = np.sin(around), np.cos(around)
        self._rows = np.array(
            [[-sine, cosine, 0], [-np.sin(up) * cosine, -np.sin(up) * sine, np.cos(up)]]
        )
        self._towards = np.array([np.cos(up) * cosine, np.cos(up) * sine, np.sin(up)])
        low, high = points.min(axis=0), points.max(axis=0)
        spare = 0.05 * float((high - low).max() or 1.0)
        ends = np.stack([low - spare, high + spare])
        corners = np.stack(np.meshgrid(*ends.T), axis=-1).reshape(-1, 3) @ self._rows.T
        (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
        around_it = 32.0
        scale = min((WIDTH - 2 * around_it) / (x1 - x0), _HIGHEST / (y1 - y0))
        width, height = (WIDTH / scale, (y1 - y0) + 2 * around_it / scale)
        x0, y0 = (x0 + x1 - width) / 2, (y0 + y1 - height) / 2
        super().__init__(
            (x0, x0 + width), (y0, y0 + height), (0, 0, WIDTH, height * scale), labels=(None, None)
        )
        self._axes.clear()
        self._draw_box(ends, flat=elevation > 80)

    @property
    def bottom(self) -> float:
        """Where the drawing ends: figures are within it."""
        return self.top + self.height

    def place(self, points: Any) -> FloatArray:
        """Where points (..., 3), or (..., 2) that are projected already, lie in the drawing."""
        points = np.asarray(points, float)
        return super().place(points @ self._rows.T if points.shape[-1] == 3 else points)

    def depth(self, points: FloatArray) -> float:
        """How near the middle of points (N, 3) is to who looks."""
        return float(points.mean(axis=0) @ self._towards)

    def _draw_box(self, ends: FloatArray, *, flat: bool) -> None:
        """Draw the floor and the walls behind, and figures along the edges in front."""
        front = np.where(self._towards > 1e-6, ends[1], ends[0])
        back, floor = ends[0] + ends[1] - front, ends[0, 2]
        ticks = [nice_ticks(low, high, 6) for low, high in ends.T.tolist()]
        at = [
            [*(value for value, _ in own), *sides] for own, sides in zip(ticks, ends.T, strict=True)
        ]
        lines = [[(x, y, floor) for y in ends[:, 1]] for x in at[0]]
        lines += [[(x, y, floor) for x in ends[:, 0]] for y in at[1]]
        walls = [(front[0], back[1]), (back[0], back[1]), (back[0], front[1])]
        if not flat:
            lines += [[(x, y, z) for x, y in walls] for z in at[2]]
            lines += [[(x, y, z) for z in ends[:, 2]] for x, y in walls]
        self.lines(lines, GRID, 0.8)
        self._label_floor(ticks, front, back, floor)
        if not flat:
            side = min(walls, key=lambda one: float(self.place([*one, floor])[0]))
            for z, name in ticks[2]:
                self.text([*side, z], name, (-16, 0))

    def _label_floor(
        self, ticks: Sequence[Sequence[tuple[float, str]]], front: Any, back: Any, floor: float
    ) -> None:
        """Write figures along the two edges of the floor in front."""
        for x, name in ticks[0]:
            self._label([x, front[1], floor], [x, back[1], floor], name)
        for y, name in ticks[1]:
            self._label([front[0], y, floor], [back[0], y, floor], name)

    def _label(self, at: Any, behind: Any, name: str) -> None:
        """Write a figure a little beyond an edge, away from what lies behind."""
        way = self.place(at) - self.place(behind)
        self.text(at, name, 15 * way / max(float(np.linalg.norm(way)), 1e-9))


def picture_plot(size: tuple[int, int], labels: tuple[str | None, str | None] = ("", "")) -> Plot:
    """Axes in the shape of a photo, y down."""
    width, height = size
    scale = min((WIDTH - _LEFT - _RIGHT) / width, _HIGHEST / height)
    left = max(_LEFT, (WIDTH - scale * width) / 2)
    box = (left, _TOP, scale * width, scale * height)
    return Plot((-0.5, width - 0.5), (height - 0.5, -0.5), box, labels=labels)


def wide_plot(
    x: Range, y: Range, height: float, labels: tuple[str | None, str | None], top: float = _TOP
) -> Plot:
    """Axes as wide as the drawing, with lines that go on from the ticks."""
    return Plot(x, y, (_BESIDE, top, WIDTH - _BESIDE - _RIGHT, height), grid=True, labels=labels)


def colour_bar(
    above: Plot, ends: Range, label: str, *, steps: int = _BAR_STEPS, beyond: bool = False
) -> Plot:
    """Say below a plot which colours stand for what.

    Args:
        above: the plot.
        ends: what the first and the last colour stand for.
        label: the unit.
        steps: how many colours there are.
        beyond: whether the last one also stands for more.

    """
    box = (above.left, above.bottom - 0.4 * _ROOM, above.width, _BAR)
    bar = Plot(ends, (0, 1), box, labels=(label, None))
    bar.image(colours((np.arange(steps) + 0.5) / steps)[None], (ends[0], 0), (ends[1], 1))
    if beyond:
        bar.point_on()
    return bar


def colours(share: FloatArray) -> FloatArray:
    """Colours (..., 4) of shares (...) from 0 to 1, from dark blue to yellow; of NaN none."""
    known = np.isfinite(share)
    step = np.rint(255 * np.clip(np.where(known, share, 0), 0, 1)).astype(np.uint8)
    painted = cv2.applyColorMap(step.reshape(-1, 1), cv2.COLORMAP_CIVIDIS)[:, 0, ::-1] / 255
    return np.concatenate([painted.reshape(*share.shape, 3), known[..., None]], axis=-1)


def nice_ticks(low: float, high: float, most: float) -> list[tuple[float, str]]:
    """Round numbers between two, about so many, and how they are written."""
    low, high = min(low, high), max(low, high)
    rough = (high - low) / max(most, 1.0)
    if not (np.isfinite(rough) and rough > 0):
        return []
    step = nice_step(rough)
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    numbers = np.arange(np.ceil(low / step - 1e-6), np.floor(high / step + 1e-6) + 1)
    values = (step * numbers + 0.0).tolist()
    return [(value, f"{value:.{digits}f}".replace("-", "−")) for value in values]


def nice_step(rough: float) -> float:
    """The least of 1, 2, 5, 10, 20 ... that is no smaller."""
    power = 10.0 ** np.floor(np.log10(rough))
    return float(power * min(one for one in (1, 2, 5, 10) if one * power >= rough * (1 - 1e-9)))


def document(plots: Sequence[Plot]) -> str:
    """Return a drawing of some plots, as a data URI."""
    height = max(plot.bottom for plot in plots)
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH:g}" height="{height:.0f}" '
        f'viewBox="0 0 {WIDTH:g} {height:.0f}" font-family="system-ui,sans-serif" '
        f'font-size="{_LETTER:g}" fill="none">' + "".join(plot.drawn() for plot in plots) + "</svg>"
    )
    return "data:image/svg+xml;base64," + b64encode(text.encode()).decode()


def _path(at: FloatArray) -> str:
    """A line through places (K, 2) in the drawing, without those that are none."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in at[np.isfinite(at).all(axis=1)].tolist())


def _stroke(colour: str, width: float, opacity: float = 1.0) -> str:
    seen = f' stroke-opacity="{opacity:g}"' if opacity < 1 else ""
    return f'fill="none" stroke="{colour}" stroke-width="{width:g}"{seen}'


def _write(x: float, y: float, words: str, anchor: str = "middle", more: str = "") -> str:
    at = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text {at} fill="{INK}"{more}>{words}</text>'
