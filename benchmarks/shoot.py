"""How many photos it takes to reach the goal with guidance: ``python benchmarks/shoot.py``.

Corners of a flat board through lenses of no fitted family, with errors of 0.1 px, photo by photo,
by three users. One follows what ``cubicfish shoot`` shows: of all poses that a hand might choose
that of the ghost, or the nearest in which the
board is whole, and not quite that. One moves at random. One fills a grid: takes, of all
poses, the one that puts corners into most of the picture's squares that have none yet, and begins
anew when all have.

photos     until the page's bar is full: the photos are enough by the verdict, and the uncertainty
           over 95 % of the field is within the goal; median over draws, those that never get there
           counted as the most that were tried
share      of the photos of the other users: of the sums over draws
true px    the camera's error against the true lens then, 95 % of the whole field, rotation taken
           out; median
"""

import argparse
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from outside import INSIDE, SIZE, board
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import SYNTHETIC_LENSES, synthetic_lens

from cubicfish import CubicfishError, Observations, aligned_difference
from cubicfish.models import cone_rays
from cubicfish.scene import Scene, Viewpoint
from cubicfish.sufficiency import Goal
from cubicfish_cli.extensions.shoot.guidance import Guide, quick_camera

LENSES = {"inside": INSIDE, **{name: synthetic_lens(name, SIZE) for name in SYNTHETIC_LENSES}}
ERRORS = CornerErrors(noise=0.1, shared=0, spread=0)
MOST, POSES = 40, 400
# A hand holds the board where the ghost is to within so many degrees, and this share of the way.
TURN_DEG, SHIFT = 4.0, 0.05
SQUARES = (8, 6)
USERS = ("guided", "random", "grid")


class Done(NamedTuple):
    """How a user fared: photos taken, whether they are enough, and how far off the camera is."""

    photos: int
    enough: bool
    true_px: float


def is_enough(pairs: Observations, goal_px: float) -> bool:
    """Whether the page would say so."""
    try:
        fit = quick_camera(pairs)
    except CubicfishError:
        return False
    goal = Goal.of(fit.fit, SIZE, goal_px)
    return not goal.explain_unmet(fit.verdict, fit.fit.uncertainty.field)


def true_error(pairs: Observations, lens) -> float:
    """95 % of the differences over the whole field that the lens shows, pixels."""
    try:
        camera = quick_camera(pairs).camera
    except CubicfishError:
        return np.inf
    angle = np.radians(getattr(lens, "max_angle_deg", 95.0) - 3)
    rays = cone_rays(angle, 1500)
    seen = getattr(lens, "far", lens)
    pixel = seen.project(rays)
    with np.errstate(invalid="ignore"):
        rays = rays[((pixel > 0) & (pixel < np.array(SIZE) - 1)).all(axis=1)]
    # Beyond its field a camera says nothing: there the radial reference goes on.
    miss, _ = aligned_difference(camera.radial, seen, rays)
    inner, _ = aligned_difference(camera, seen, rays)
    length = np.linalg.norm(np.where(np.isfinite(inner), inner, miss), axis=1)
    return float(np.percentile(np.nan_to_num(length, nan=np.inf), 95))


def shaken(view: Viewpoint, scene: Scene, rng: np.random.Generator) -> Viewpoint:
    """The view from a pose that a hand meant to be this one, the board still whole in it."""
    turn, shift = view.pose
    away = np.linalg.norm(shift)
    for _ in range(30):
        matrix = cv2.Rodrigues(np.radians(TURN_DEG) * rng.standard_normal(3))[0]
        turned = cv2.Rodrigues(matrix @ cv2.Rodrigues(np.asarray(turn))[0])[0].ravel()
        found = scene.view((turned, shift + SHIFT * away * rng.standard_normal(3)))
        if found is not None and found.whole:
            return found
    return view


def nearest(views: Sequence[Viewpoint], ghost: np.ndarray) -> Viewpoint:
    """The view whose corners are nearest to the ghost's, pixels (N, 2), of those that show all.

    A plain board looks alike after half a turn.
    """
    away = [
        min(
            float(np.median(np.linalg.norm(view.seen.pixel - other, axis=1)))
            for other in (ghost, ghost[::-1])
        )
        for view in views
    ]
    return views[int(np.nanargmin(away))]


def filled(view: Viewpoint) -> np.ndarray:
    """Which squares of the picture a view puts corners into."""
    column, row = np.clip((view.pixel / SIZE * SQUARES).astype(int), 0, np.array(SQUARES) - 1).T
    grid = np.zeros(SQUARES, bool)
    grid[column, row] = True
    return grid


def one_draw(job: tuple[str, int, float]) -> dict[str, Done]:
    """How each user fares, taking one photo after the other until they are enough."""
    name, seed, goal_px = job
    warnings.simplefilter("ignore")
    lens, target = LENSES[name], board()
    scene = Scene(target=target, lens=lens, image_size=SIZE)
    views = scene.views(POSES, seed=1000 + seed)
    fields = np.any([filled(view) for view in views], axis=0)
    rng = np.random.default_rng((seed, 7))
    guide = Guide(target, SIZE, goal_px)

    def guided(shots: list[Viewpoint], said) -> Viewpoint:
        if said.view is None:
            return views[rng.integers(len(views))]
        meant = scene.view(said.view.pose)
        if meant is not None and meant.whole:
            return meant
        return nearest(views, said.lens.project(said.view.seen.camera))

    def random(shots: list[Viewpoint], said) -> Viewpoint:
        return views[rng.integers(len(views))]

    def grid(shots: list[Viewpoint], said) -> Viewpoint:
        empty = fields.copy()
        for shot in shots:
            empty &= ~filled(shot)
            if not empty.any():
                empty = fields.copy()
        news = [(filled(view) & empty).sum() for view in views]
        return views[rng.choice(np.flatnonzero(news == np.max(news)))]

    users: dict[str, Callable] = {"guided": guided, "random": random, "grid": grid}
    done = {}
    for user, choose in users.items():
        shots, parts, enough = list[Viewpoint](), list[Observations](), False
        said = guide.after(None)
        while len(shots) < MOST and not enough:
            shots.append(shaken(choose(shots, said), scene, rng))
            part, _ = simulated_corners(
                lens, target, 1, seed=int(rng.integers(1 << 30)), errors=ERRORS,
                image_size=SIZE, poses=(shots[-1].pose,),
            )  # fmt: skip
            name = f"photo_{len(parts):03d}"
            parts.append(replace(part.with_target(target), images=(name,)))
            pairs = Observations.joined(parts)
            enough = is_enough(pairs, goal_px)
            if user == "guided":
                said = guide.after(pairs)
        done[user] = Done(len(shots), enough, true_error(pairs, lens))
    return done


def main() -> None:
    """Simulate, count, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--draws", type=int, default=30)
    parser.add_argument("--goal", type=float, default=0.2)
    parser.add_argument("--lenses", nargs="+", default=list(LENSES), choices=list(LENSES))
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    print(f"goal {given.goal} px, {given.draws} draws\n")
    print(f"{'lens':<14}{'user':<9}{'photos':>7}{'share':>7}{'never':>7}{'true px':>9}")
    every = dict.fromkeys(USERS, 0)
    with ProcessPoolExecutor(given.jobs) as pool:
        for name in given.lenses:
            jobs = [(name, seed, given.goal) for seed in range(given.draws)]
            draws = list(pool.map(one_draw, jobs))
            sums = {user: sum(draw[user].photos for draw in draws) for user in USERS}
            for user in USERS:
                photos, enough, true_px = zip(*(draw[user] for draw in draws), strict=True)
                every[user] += sums[user]
                print(
                    f"{name:<14}{user:<9}{np.median(photos):>7.0f}"
                    f"{100 * sums['guided'] / sums[user]:>6.0f}%{enough.count(False):>7}"
                    f"{np.median(true_px):>9.3f}",
                    flush=True,
                )
    print()
    for user in USERS[1:]:
        share = every["guided"] / every[user]
        print(f"guided / {user}: {100 * share:.0f} % of the photos")


if __name__ == "__main__":
    main()
