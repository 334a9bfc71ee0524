"""What the camera itself costs in C, and how exact it is in each language.

    python benchmarks/native.py calibration/camera.yaml lens_b/camera.yaml ...

Processor time of one point, at -O2: the least of five runs over 10,000 points, one after the
other. Exactness is the largest difference from this project's own answers, over 10,000 rays, and
points at 30 to 3,000 of the camera's units.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from languages import LANGUAGES, Answers, Questions, ask
from lenses import random_rays

from cubicfish import CameraFile, load_camera
from cubicfish_cli.extensions.native.source import source_text

_COUNT = 10_000
_TIMES = """
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "camera.h"
static double points[{count}][3], pixel[{count}][2], out[6];
static double sum;
#define TIME(call) {{ \\
  double least = 1e9, own; int run, k, again; \\
  for (run = 0; run < 5; ++run) {{ \\
    clock_t start = clock(); \\
    for (again = 0; again < 20; ++again) \\
      for (k = 0; k < {count}; ++k) {{ call; sum += out[0]; }} \\
    own = (double)(clock() - start) * 1e9 / CLOCKS_PER_SEC / 20 / {count}; \\
    if (own < least) least = own; \\
  }} \\
  printf("%.0f ", least); }}
int main(void) {{
  int k;
  if (fread(points, sizeof points, 1, stdin) != 1) return 1;
  for (k = 0; k < {count}; ++k) if (!camera_project(points[k], pixel[k])) return 2;
  TIME(camera_project_ray(points[k], out))
  TIME(camera_project(points[k], out))
  TIME(camera_project_jacobian(points[k], pixel[k], out))
  TIME(camera_unproject(pixel[k], out))
  return sum == 0.5;
}}
"""


def cost_ns(known: CameraFile, asked: Questions, compiler: str, folder: Path) -> list[str]:
    """Processor time of project_ray, project, project_jacobian and unproject."""
    (folder / "camera.h").write_text(source_text(known, "c", None))
    (folder / "times.c").write_text(_TIMES.format(count=_COUNT))
    program = folder / "times"
    words = [compiler, "-std=c99", "-O2", folder / "times.c", "-o", program, "-lm"]
    subprocess.run([str(word) for word in words], check=True)
    given = asked.points.tobytes()
    done = subprocess.run([str(program)], input=given, capture_output=True, check=True)
    return done.stdout.decode().split()


def asked_of(known: CameraFile) -> Questions:
    """Rays, points and pixels of its field, in numbers that floats hold."""
    rng, camera = np.random.default_rng(0), known.camera
    rays = random_rays(camera.max_angle_deg - 0.01, 2 * _COUNT)
    points = rays * rng.uniform(30, 3000, (len(rays), 1))
    pixel = camera.project(points, near=True)
    seen = np.flatnonzero(np.isfinite(pixel[:, 0]))[:_COUNT]
    numbers = np.hstack([rays, points, pixel])[seen].astype(np.float32).astype(float)
    return Questions(rays=numbers[:, :3], points=numbers[:, 3:6], pixel=numbers[:, 6:])


def differences(known: CameraFile, asked: Questions, found: Answers) -> list[float]:
    """The largest: of pixels of rays and of points, px; of rays, radians; NaN where one is lost."""
    camera = known.camera
    seen = camera.project(asked.rays), camera.project(asked.points, near=True)
    pairs = zip((found.of_rays, found.of_points), seen, strict=True)
    ways = found.of_pixel - camera.unproject(asked.pixel)
    return [*(np.abs(one - two).max() for one, two in pairs), np.linalg.norm(ways, axis=1).max()]


def row(*cells: object) -> None:
    """Print a row of a table."""
    print(
        "".join(f"{cell:<20}" for cell in cells[:2]) + "".join(f"{cell:>12}" for cell in cells[2:])
    )


def main() -> None:
    """Print a table of costs, and one of differences."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("cameras", nargs="+", type=Path)
    names = {f"camera{k}": path for k, path in enumerate(parser.parse_args().cameras)}
    labels = {name: path.resolve().parent.name for name, path in names.items()}
    cameras = {name: load_camera(path) for name, path in names.items()}
    asked = {name: asked_of(known) for name, known in cameras.items()}
    with tempfile.TemporaryDirectory() as folder:
        row("ns a point", "compiler", "ray", "project", "jacobian", "unproject")
        for compiler in filter(shutil.which, ("gcc", "clang")):
            for name, known in cameras.items():
                row(labels[name], compiler, *cost_ns(known, asked[name], compiler, Path(folder)))
        row("\nlargest difference", "language", "rays px", "points px", "pixels rad")
        for language, own in LANGUAGES.items():
            if shutil.which(own.program) is None:
                continue
            answers = ask(language, cameras, asked, Path(tempfile.mkdtemp(dir=folder)))
            for name, known in cameras.items():
                found = differences(known, asked[name], answers[name])
                row(labels[name], language, *(f"{one:.1e}" for one in found))


if __name__ == "__main__":
    main()
