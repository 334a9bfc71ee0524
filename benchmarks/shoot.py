"""How many photos it takes to reach the goal with guidance: ``python benchmarks/shoot.py``.

Corners of a flat board through lenses of no fitted family, with errors of 0.1 px, photo by photo,
by four users:

guided    follows what ``cubicfish shoot`` shows: holds the board where the ghost is, and where
          it is cut there, brings it inwards until it is whole
random    moves at random
squares   fills a grid of 10x10 squares, by which OpenCV's interactive-calibration counts coverage
          (``estimateCoverageQuality`` of its calibController.cpp): takes an empty square at random,
          and a pose at a usual distance and tilt that has a corner in it; begins anew when all are
          filled. Usual is a tilt below 45°, as MATLAB's Camera Calibrator asks for, and a distance
          of the middle half of all
best      fills the same grid as nobody can by hand: takes of all poses, near and tilted ones too,
          the one with corners in most empty squares

All poses are 400 of those from which the board is seen whole, and each user's hand misses what it
means by the same.

goal       photos until the uncertainty that the camera states is within the goal over 95 % of the
           field; mean over draws, those that never get there counted as the most that were tried,
           which favours who needs more. Only who follows the page is judged after each photo. The
           others' count is found by halving, as if more photos never took back what fewer reached:
           of 118 draws that were judged after each, 116 gave the same
enough     until the page's bar is full: the verdict asks for no more photos, too, which of a flat
           board it does below eight
share      the guided user's photos as a share of the other's: of the sums over draws
never      draws in which photos were never enough
true px    the camera's error against the true lens when the goal was reached, and when photos were
           enough: 95 % of the whole field, rotation taken out; median

What is in the file of --record already is not simulated again.
"""

import argparse
import json
import os
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from outside import INSIDE, SIZE, board
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import SYNTHETIC_LENSES, synthetic_lens

from cubicfish import Calibration, CubicfishError, Observations, aligned_difference
from cubicfish.models import cone_rays
from cubicfish.scene import Scene, Viewpoint
from cubicfish.sufficiency import Goal
from cubicfish_cli.extensions.shoot.guidance import Guidance, Guide, quick_camera

LENSES = {"inside": INSIDE, **{name: synthetic_lens(name, SIZE) for name in SYNTHETIC_LENSES}}
ERRORS = CornerErrors(noise=0.1, shared=0, spread=0)
FEWEST, MOST, POSES = 3, 40, 400
# A hand holds the board where it means to within so many degrees, and this share of the way.
TURN_DEG, SHIFT = 4.0, 0.05
SQUARES = 10
USUAL_TILT_DEG, USUAL_DISTANCES = 45.0, (25, 75)
USERS = ("guided", "random", "squares", "best")
# What is known after each photo: stated uncertainty, whether photos are enough, the true error.
Course = list[tuple[float, bool, float]]
NOT_KNOWN = (np.inf, False, np.inf)


def fitted(pairs: Observations) -> Calibration | None:
    """The quick camera of a page; None where there is none yet."""
    try:
        return quick_camera(pairs)
    except CubicfishError:
        return None


def judged(camera: Calibration | None, lens, goal_px: float) -> tuple[float, bool, float]:
    """What is known of a camera: stated uncertainty, whether photos are enough, true error."""
    if camera is None:
        return NOT_KNOWN
    field = camera.fit.uncertainty.field
    unmet = Goal.of(camera.fit, SIZE, goal_px).explain_unmet(camera.verdict, field)
    return field.p95_px if field else np.inf, not unmet, true_error(camera, lens)


def true_error(known: Calibration, lens) -> float:
    """95 % of the differences over the whole field that the lens shows, pixels."""
    angle = np.radians(getattr(lens, "max_angle_deg", 95.0) - 3)
    rays = cone_rays(angle, 500)
    seen = getattr(lens, "far", lens)
    pixel = seen.project(rays)
    with np.errstate(invalid="ignore"):
        rays = rays[((pixel > 0) & (pixel < np.array(SIZE) - 1)).all(axis=1)]
    # Beyond its field a camera says nothing: there the radial reference goes on.
    miss, _ = aligned_difference(known.camera.radial, seen, rays)
    inner, _ = aligned_difference(known.camera, seen, rays)
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


def held(said: Guidance, scene: Scene) -> Viewpoint | None:
    """The ghost's pose; where the board is cut there, brought inwards until it is whole."""
    assert said.view is not None
    turn, shift = said.view.pose
    way = said.view.direction
    inwards = np.cross(way, [0, 0, 1.0])
    inwards /= max(float(np.linalg.norm(inwards)), 1e-9)
    for deg in range(61):
        matrix = cv2.Rodrigues(np.radians(deg) * inwards)[0]
        turned = cv2.Rodrigues(matrix @ cv2.Rodrigues(np.asarray(turn))[0])[0].ravel()
        found = scene.view((turned, matrix @ shift))
        if found is not None and found.whole:
            return found
    return None


def filled(view: Viewpoint) -> np.ndarray:
    """Which squares of the picture a view puts corners into."""
    column, row = np.clip((view.pixel / SIZE * SQUARES).astype(int), 0, SQUARES - 1).T
    grid = np.zeros((SQUARES, SQUARES), bool)
    grid[column, row] = True
    return grid


def usual(views: Sequence[Viewpoint]) -> list[Viewpoint]:
    """Those at a usual distance and tilt."""
    away = np.array([np.linalg.norm(view.middle) for view in views])
    near, far = np.percentile(away, USUAL_DISTANCES)
    least = np.cos(np.radians(USUAL_TILT_DEG))
    faced = np.array([-view.front @ view.direction for view in views]) > least
    kept = np.flatnonzero(faced & (away >= near) & (away <= far))
    return [views[index] for index in kept]


def still_empty(views: Sequence[Viewpoint], shots: Sequence[Viewpoint]) -> np.ndarray:
    """Squares that these views can fill, and photos so far did not; all of them after that."""
    every = np.any([filled(view) for view in views], axis=0)
    empty = every.copy()
    for shot in shots:
        empty &= ~filled(shot)
        empty = empty if empty.any() else every.copy()
    return empty


def users(
    views: list[Viewpoint], scene: Scene, rng: np.random.Generator
) -> dict[str, Callable[[list[Viewpoint], Guidance], Viewpoint]]:
    """What each user means to do next, of photos so far and what the page says."""

    def guided(shots: list[Viewpoint], said: Guidance) -> Viewpoint:
        if said.view is None:
            return views[rng.integers(len(views))]
        return held(said, scene) or views[rng.integers(len(views))]

    def random(shots: list[Viewpoint], said: Guidance) -> Viewpoint:
        return views[rng.integers(len(views))]

    by_hand = usual(views)

    def squares(shots: list[Viewpoint], said: Guidance) -> Viewpoint:
        square = rng.choice(np.argwhere(still_empty(by_hand, shots)))
        there = [view for view in by_hand if filled(view)[tuple(square)]]
        return there[rng.integers(len(there))]

    def best(shots: list[Viewpoint], said: Guidance) -> Viewpoint:
        empty = still_empty(views, shots)
        news = [(filled(view) & empty).sum() for view in views]
        return views[rng.choice(np.flatnonzero(news == np.max(news)))]

    return {"guided": guided, "random": random, "squares": squares, "best": best}


@cache
def seen_whole(lens: str, seed: int) -> tuple[Scene, list[Viewpoint]]:
    """The board before a lens, and all poses that a user chooses from."""
    scene = Scene(target=board(), lens=LENSES[lens], image_size=SIZE)
    return scene, scene.views(POSES, seed=1000 + seed)


def one_course(job: tuple[str, int, str, float]) -> Course:
    """How a user fares, taking one photo after the other until they are enough."""
    name, seed, user, goal_px = job
    warnings.simplefilter("ignore")
    lens, target = LENSES[name], board()
    scene, views = seen_whole(name, seed)
    rng = np.random.default_rng((seed, USERS.index(user)))
    guide = Guide(target, SIZE, goal_px)
    choose = users(views, scene, rng)[user]
    shots, parts, course = list[Viewpoint](), list[Observations](), Course()
    said = guide.after(None)
    while len(shots) < MOST and not (course and course[-1][1]):
        shots.append(shaken(choose(shots, said), scene, rng))
        part, _ = simulated_corners(
            lens, target, 1, seed=int(rng.integers(1 << 30)), errors=ERRORS,
            image_size=SIZE, poses=(shots[-1].pose,),
        )  # fmt: skip
        parts.append(replace(part.with_target(target), images=(f"photo_{len(parts):03d}",)))
        if user == "guided":
            said = guide.after(Observations.joined(parts))
            course.append(judged(said.fitted, lens, goal_px))
    if user == "guided":
        return course

    @cache
    def after(count: int) -> tuple[float, bool, float]:
        return judged(fitted(Observations.joined(parts[:count])), lens, goal_px)

    end = first_count(lambda count: after(count)[1], MOST)
    reached = first_count(lambda count: after(count)[0] <= goal_px, end)
    known = {count: after(count) for count in (reached, end)}
    return [known.get(count, NOT_KNOWN) for count in range(1, end + 1)]


def first_count(is_so: Callable[[int], bool], most: int) -> int:
    """From how many photos on something is so; ``most`` where it is not even then."""
    before = FEWEST - 1
    while is_so(most) and most - before > 1:
        middle = (before + most) // 2
        before, most = (before, middle) if is_so(middle) else (middle, most)
    return most


def at_goal(course: Course, goal_px: float) -> int:
    """How many photos it took until the goal was reached."""
    return next((n for n, one in enumerate(course, 1) if one[0] <= goal_px), len(course))


def print_rows(title: str, courses: Mapping[str, Sequence[Course]], goal_px: float) -> None:
    """Print a row of each user, of their courses in the same draws."""
    ends = {
        user: [[at_goal(one, goal_px) for one in own], [len(one) for one in own]]
        for user, own in courses.items()
    }
    for user, own in courses.items():
        line = f"{title:<14}{user:<9}"
        for counts, guided in zip(ends[user], ends.get("guided", ends[user]), strict=True):
            line += f"{np.mean(counts):>8.1f}{100 * sum(guided) / sum(counts):>6.0f}%"
        line += f"{sum(not one[-1][1] for one in own):>7}"
        for counts in ends[user]:
            line += (
                f"{np.median([one[n - 1][2] for n, one in zip(counts, own, strict=True)]):>9.3f}"
            )
        print(line, flush=True)


def main() -> None:
    """Simulate, count, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--draws", type=int, default=30)
    parser.add_argument("--goal", type=float, default=0.2)
    parser.add_argument("--lenses", nargs="+", default=list(LENSES), choices=list(LENSES))
    parser.add_argument("--users", nargs="+", default=list(USERS), choices=USERS)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--record", type=Path, help="a file of draws, which goes on from its end")
    given = parser.parse_args()
    known = dict[tuple[Any, ...], Course]()
    if given.record and given.record.exists():
        for line in given.record.read_text(encoding="utf-8").splitlines():
            job, course = json.loads(line)
            known[tuple(job)] = course
    # One draw of each lens after the other: what there is when it is stopped is of all lenses.
    jobs = [
        (name, seed, user, given.goal)
        for seed in range(given.draws)
        for name in given.lenses
        for user in given.users
    ]
    missing = [job for job in jobs if job not in known]
    with ProcessPoolExecutor(given.jobs) as pool:
        for job, course in zip(missing, pool.map(one_course, missing), strict=True):
            known[job] = course
            print(*job[:3], at_goal(course, given.goal), len(course), flush=True)
            if given.record:
                with given.record.open("a", encoding="utf-8") as file:
                    file.write(json.dumps([job, course]) + "\n")
    print(f"\ngoal {given.goal} px, {given.draws} draws\n")
    print(f"{'lens':<14}{'user':<9}{'goal':>8}{'share':>7}{'enough':>8}{'share':>7}{'never':>7}"
          f"{'true px, then':>18}")  # fmt: skip
    for names in (*([name] for name in given.lenses), given.lenses):
        courses = {
            user: [known[job] for job in jobs if job[0] in names and job[2] == user]
            for user in given.users
        }
        print_rows(names[0] if len(names) == 1 else "all", courses, given.goal)


if __name__ == "__main__":
    main()
