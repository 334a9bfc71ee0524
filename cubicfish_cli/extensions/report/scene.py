"""Views in space of the target and the photos' places."""

import numpy as np

from cubicfish.solve import Poses
from cubicfish_cli.inputs.calibration_facts import Facts
from cubicfish_cli.render.pages import figures as page
from cubicfish_cli.render.pages.plot import INK, Space

# Size of a drawn camera, as a share of all that is drawn.
_CAMERA = 0.06
_VIEWS = (("Where the photos were taken from", 25, -50), ("The same from above", 89.9, -90))


def scene_figures(facts: Facts) -> dict[str, page.Drawn]:
    """Draw the target with the photos' places from two sides, by name; none if no pose is known."""
    poses = Poses.of_photos(facts.fit.poses, [*facts.fit.poses])
    if poses is None:
        return {}
    rotation = poses.rotation
    centre = -np.einsum("nij,ni->nj", rotation, poses.translation)
    boards = () if facts.target is None else facts.target.boards
    # A fit and its file differ in the last digits, but the page must be the same.
    plates = [board.outline().astype(np.float32).astype(float) for board in boards]
    loose = [plate for board, plate in zip(boards, plates, strict=True) if board.points is not None]
    if not boards and facts.errors is not None:
        loose = [facts.errors.pairs.world]
    middle = np.concatenate([*plates, *loose, centre]).mean(axis=0)
    turn = page.upright((middle - centre).mean(axis=0), -rotation[:, 1].mean(axis=0))
    everything = np.concatenate([*plates, *loose, centre]) @ turn.T
    several = len(boards) <= len(page.BOARD_COLOURS)
    colours = page.BOARD_COLOURS if several else (page.BLUE,) * len(boards)
    size = _CAMERA * float(np.ptp(everything, axis=0).max() or 1.0)
    drawn = {}
    for name, (title, elevation, azimuth) in zip(("scene-side", "scene-top"), _VIEWS, strict=True):
        space = Space(everything, elevation, azimuth)
        seen = [
            (plate @ turn.T, colour)
            for board, plate, colour in zip(boards, plates, colours, strict=False)
            if board.points is None
        ]
        for plate, colour in sorted(seen, key=lambda one: space.depth(one[0])):
            space.area(plate, colour, 0.3)
        for points in loose:
            shown = points[page.some(len(points), page.MOST_DOTS // 4)] @ turn.T
            space.dots(shown, page.BLUE, 2.0)
        page.draw_cameras(space, centre @ turn.T, rotation @ turn.T, size, [INK] * len(centre))
        drawn[name] = page.finished(
            space,
            name=name,
            title=title,
            label=f"{len(plates)} boards and {len(centre)} camera poses",
            caption=f"{len(centre):,} photo{'s' * (len(centre) != 1)}; lengths are in "
            f"{facts.units or 'the units of the target'}.",
            keys=(
                *(
                    page.Key(kind="area", colour=colour, text=board.name)
                    for board, colour in zip(boards * several, colours, strict=False)
                ),
                page.Key(
                    kind="line", colour=INK, text="a photo: the open side looks at the target"
                ),
            ),
        )
    return drawn
