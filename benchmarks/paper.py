"""Zhu & Yin (2010), Section 4.1, again: their synthetic camera, both lifts, three ways to fit.

Run ``python benchmarks/paper.py`` (matplotlib is needed for the figures, ``--no-figures`` leaves
them out). Prints tables of errors against the truth and draws docs/figures/paper_*.svg.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish import FitError, Observations, calibrate
from cubicfish.fit.point_fit import fit_ratio
from cubicfish.models.lift import lift

FloatArray = npt.NDArray[np.float64]

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
SIZE = (640, 480)
CENTRE = np.array([320.0, 240.0])
FOCAL, K = 150.0, (15.0, -20.0, 2.0, -10.0)
# The paper's camera looks along −z; turned by half a turn about x it looks along +z.
HALF_TURN = np.diag([1.0, -1.0, -1.0])
NOISES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
STAGES = ("plain", "reweighted", "refined")
PARTS = {
    "corners": "RMS at the corners",
    "on": "median between, on the planes",
    "off": "median off the planes",
}
PITCH = 30.0


@dataclass(frozen=True)
class Pose:
    """One of the paper's views."""

    name: str
    rotation: FloatArray
    translation: FloatArray

    def camera_points(self, world: FloatArray) -> FloatArray:
        """World (N, 3) -> the frame of a camera that looks along +z."""
        return (world @ self.rotation.T + self.translation) @ HALF_TURN


POSES = (
    Pose(
        "view 1",
        np.array(
            [
                [0.9980, 0.0092, 0.0618],
                [-0.0072, 0.9995, -0.0312],
                [-0.0621, 0.0307, 0.9976],
            ]
        ),
        np.array([-232.3595, -182.8318, -492.5258]),
    ),
    # Of the second translation only its third component is legible in print; the other two are
    # the first view's.
    Pose(
        "view 2",
        np.array(
            [
                [0.9982, 0.0415, 0.0442],
                [-0.0388, 0.9974, -0.0602],
                [-0.0466, 0.0584, 0.9972],
            ]
        ),
        np.array([-232.3595, -182.8318, -600.6887]),
    ),
)


def true_pixels(points: FloatArray) -> FloatArray:
    """The paper's lens: camera-frame points (N, 3) -> pixels (N, 2)."""
    rho = np.hypot(points[:, 0], points[:, 1])
    theta = np.arctan2(rho, points[:, 2])
    radius = FOCAL * theta + sum(k * theta ** (i + 2) for i, k in enumerate(K))
    return CENTRE + (radius / np.maximum(rho, 1e-12))[:, None] * points[:, :2]


def planes(ticks: FloatArray) -> FloatArray:
    """A grid of ticks x ticks on each of the planes XOY, YOZ and XOZ: (3 N², 3)."""
    a, b = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
    zero = np.zeros_like(a)
    return np.vstack([np.column_stack(axes) for axes in ((a, b, zero), (zero, a, b), (a, zero, b))])


OBJECT = planes(PITCH * np.arange(1, 9))
# Points that no fit has seen: between the corners on the planes, and off the planes between them.
ON_PLANES = planes(PITCH * np.linspace(1.25, 7.75, 12))
OFF_PLANES = np.random.default_rng(7).uniform(1.25 * PITCH, 7.75 * PITCH, (400, 3))


def rms(miss: FloatArray) -> float:
    """sqrt(mean(dx² + dy²)), pixels."""
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=1))))


def median(miss: FloatArray) -> float:
    """Median length, pixels."""
    return float(np.median(np.linalg.norm(miss, axis=1)))


def unit(points: FloatArray) -> FloatArray:
    """Rays of points."""
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def predict(P: FloatArray, local: FloatArray) -> FloatArray:
    """Ratios of cubics, poles and all: (N, 3) -> (N, 2)."""
    homogeneous = lift(local) @ P.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def normalised(world: FloatArray) -> FloatArray:
    """World points about 0 and of order 1, by the object's own middle and size."""
    return (world - OBJECT.mean(axis=0)) / np.sqrt(np.mean(np.var(OBJECT, axis=0)))


@dataclass(frozen=True)
class Errors:
    """Errors against the truth of one fit, pixels, by stage.

    RMS at the corners; median between them on the planes, and off the planes. Beside a pole the
    RMS of points that no fit has seen is any number.
    """

    corners: dict[str, float]
    on: dict[str, float]
    off: dict[str, float]


Probes = list[tuple[FloatArray, FloatArray]]


def errors_of(fit: Any, corners: Probes, on: Probes, off: Probes) -> Errors:
    """Errors of the three stages; the others are (points of order 1, true pixels)."""

    def misses(stage: str, probes: Probes) -> FloatArray:
        P = getattr(fit, stage)
        return np.vstack([predict(P, local) - exact for local, exact in probes])

    return Errors(
        corners={stage: rms(misses(stage, corners)) for stage in STAGES},
        on={stage: median(misses(stage, on)) for stage in STAGES},
        off={stage: median(misses(stage, off)) for stage in STAGES},
    )


def point_lift(pose: Pose, noise: float, rng: np.random.Generator) -> tuple[int, Errors]:
    """The paper's model as printed: one view, world points."""
    exact = true_pixels(pose.camera_points(OBJECT))
    fit = fit_ratio(normalised(OBJECT), exact + noise * rng.standard_normal(exact.shape))
    probes = [
        [(normalised(world), true_pixels(pose.camera_points(world)))]
        for world in (OBJECT, ON_PLANES, OFF_PLANES)
    ]
    return len(fit.refined[0]) - len(fit.null), errors_of(fit, *probes)


def fit_rays(noise: float, rng: np.random.Generator) -> Any:
    """P on the rays of both views."""
    points = np.vstack([pose.camera_points(OBJECT) for pose in POSES])
    exact = true_pixels(points)
    return fit_ratio(unit(points), exact + noise * rng.standard_normal(exact.shape))


def ray_lift(noise: float, rng: np.random.Generator) -> tuple[int, Errors]:
    """Cubics of the ray, both views together, poses known: the model alone."""
    fit = fit_rays(noise, rng)
    probes = [
        [
            (unit(pose.camera_points(world)), true_pixels(pose.camera_points(world)))
            for pose in POSES
        ]
        for world in (OBJECT, ON_PLANES, OFF_PLANES)
    ]
    return len(fit.refined[0]) - len(fit.null), errors_of(fit, *probes)


def whole_calibration(noise: float, rng: np.random.Generator) -> tuple[float, float, float] | None:
    """``calibrate``: both views, poses unknown; errors as in :class:`Errors`, None if refused."""
    exact = np.vstack([true_pixels(pose.camera_points(OBJECT)) for pose in POSES])
    count = len(OBJECT)
    none = np.zeros(2 * count, np.intp)
    pairs = Observations(
        image_size=SIZE,
        images=tuple(pose.name for pose in POSES),
        boards=(),
        image=np.repeat(np.arange(2), count),
        world=np.vstack([OBJECT, OBJECT]),
        pixel=exact + noise * rng.standard_normal(exact.shape),
        weight=np.ones(2 * count),
        board=none - 1,
        column=np.arange(2 * count),
        row=none,
    )
    try:
        result = calibrate(pairs, hold_out=False)
    except FitError:
        return None

    def misses(world: FloatArray) -> FloatArray:
        return np.vstack(
            [
                result.camera.project(result.poses.apply(np.full(len(world), i), world))
                - true_pixels(pose.camera_points(world))
                for i, pose in enumerate(POSES)
            ]
        )

    return rms(misses(OBJECT)), median(misses(ON_PLANES)), median(misses(OFF_PLANES))


def print_poles(draws: int) -> None:
    """How many free fits have P3Φ ≤ 0 at a ray to the object's volume, and what it does."""
    world = np.random.default_rng(1).uniform(PITCH, 8 * PITCH, (20_000, 3))
    points = np.vstack([pose.camera_points(world) for pose in POSES])
    rays, exact = unit(points), true_pixels(points)
    print(f"\nray, both views: poles at the rays to {len(rays):,} points, {draws} draws")
    print("noise       stage  draws with a pole  median error  largest error (median of draws)")
    for noise in (0.1, 1.0):
        fits = [
            fit_rays(noise, np.random.default_rng(1000 * draw + round(100 * noise)))
            for draw in range(draws)
        ]
        for stage in STAGES:
            poles, middle, largest = [], [], []
            for fit in fits:
                P = getattr(fit, stage)
                away = np.linalg.norm(predict(P, rays) - exact, axis=1)
                poles.append((lift(rays) @ P[2] <= 0).any())
                middle.append(np.median(away))
                largest.append(away.max())
            print(
                f"{noise:5.1f}  {stage:>10}  {sum(poles):17d}  {np.median(middle):12.3f}  "
                f"{np.median(largest):13.3f}",
                flush=True,
            )


def middle_of(runs: list[Errors]) -> Errors:
    """The median over runs, each figure by itself: one run with a pole must not speak for all."""
    return Errors(
        **{
            part: {
                stage: float(np.median([getattr(run, part)[stage] for run in runs]))
                for stage in STAGES
            }
            for part in PARTS
        }
    )


def curves(draws: int) -> Iterator[tuple[str, int, dict[float, Errors]]]:
    """The models, their rank, and errors by noise."""
    models = {f"point, {pose.name}": lambda n, r, p=pose: point_lift(p, n, r) for pose in POSES}
    models["ray, both views"] = ray_lift
    for name, model in models.items():
        found = {}
        for noise in NOISES:
            runs = [
                model(noise, np.random.default_rng(1000 * draw + round(100 * noise)))
                for draw in range(draws if noise else 1)
            ]
            found[noise] = middle_of([errors for _, errors in runs])
        yield name, runs[0][0], found


def main() -> None:
    """Print the tables, draw the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=30, help="noise draws a level")
    parser.add_argument("--no-figures", action="store_true")
    options = parser.parse_args()
    found = {}
    print(f"errors against the truth, px; median of {options.draws} draws")
    for name, rank, by_noise in curves(options.draws):
        found[name] = by_noise
        print(f"\n{name}: rank {rank} of 20")
        print("noise  " + "  ".join(f"{title:^30}" for title in PARTS.values()))
        print("       " + "  ".join(f"{stage:>10}"[-10:] for _ in PARTS for stage in STAGES))
        for noise, errors in by_noise.items():
            cells = [getattr(errors, part)[stage] for part in PARTS for stage in STAGES]
            print(f"{noise:5.1f}  " + "  ".join(f"{cell:10.3f}"[:10] for cell in cells))
    print_poles(options.draws)
    print("\nray, both views, by cubicfish calibrate with the poses unknown")
    print("noise  " + "  ".join(PARTS.values()))
    full = {}
    for noise in NOISES:
        draws = max(1, options.draws // 10) if noise else 1
        runs = [whole_calibration(noise, np.random.default_rng(draw)) for draw in range(draws)]
        done = [run for run in runs if run is not None]
        full[noise] = np.median(done, axis=0) if done else np.full(len(PARTS), np.nan)
        cells = [f"{v:{len(t)}.3f}" for v, t in zip(full[noise], PARTS.values(), strict=True)]
        refused = f"  {draws - len(done)} of {draws} refused" if len(done) < draws else ""
        print(f"{noise:5.1f}  " + "  ".join(cells) + refused, flush=True)
    if not options.no_figures:
        draw_figures(found, full)


def draw_figures(found: dict[str, dict[float, Errors]], full: dict[float, FloatArray]) -> None:
    """Figure 1: the object in both views. 2: errors at the corners. 3: off the planes."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "cubicfish"
    matplotlib.rcParams["svg.fonttype"] = "none"
    import matplotlib.pyplot as plt

    FIGURES.mkdir(parents=True, exist_ok=True)
    colours = ("#0072b2", "#d55e00", "#009e73")  # told apart by everyone (Okabe & Ito)

    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2))
    for axis, pose in zip(axes, POSES, strict=True):
        pixel = true_pixels(pose.camera_points(OBJECT)).reshape(3, -1, 2)
        for plane, colour, label in zip(pixel, colours, ("XOY", "YOZ", "XOZ"), strict=True):
            axis.plot(*plane.T, ".", color=colour, label=label, markersize=4)
        axis.set(xlim=(0, SIZE[0]), ylim=(SIZE[1], 0), aspect="equal", title=pose.name)
    axes[0].legend(fontsize=8)
    save(figure, "paper_1_views.svg")

    for number, (part, title) in ((2, ("corners", PARTS["corners"])), (3, ("off", PARTS["off"]))):
        figure, axes = plt.subplots(1, 3, figsize=(9, 3), sharey=True)
        for axis, (name, by_noise) in zip(axes, found.items(), strict=True):
            for stage, colour, marker in zip(STAGES, colours, "so^", strict=True):
                values = [getattr(errors, part)[stage] for errors in by_noise.values()]
                axis.plot(list(by_noise), values, marker + "-", color=colour, label=stage, ms=3)
            if name.startswith("ray"):
                values = [errors[list(PARTS).index(part)] for errors in full.values()]
                axis.plot(list(full), values, "k:", label="calibrate, poses unknown")
            axis.set(title=name, xlabel="noise, px", yscale="log")
            axis.grid(alpha=0.3)
        axes[0].set_ylabel(f"{title}, px")
        axes[-1].legend(fontsize=7)
        save(figure, f"paper_{number}_{part}.svg")


def save(figure, name: str) -> None:
    """Write a figure as SVG, the same bytes each time."""
    figure.tight_layout()
    figure.savefig(FIGURES / name, metadata={"Date": None})


if __name__ == "__main__":
    main()
