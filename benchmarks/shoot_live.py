"""How quick a shoot answers, and what kills leave of it: ``python benchmarks/shoot_live.py``.

Rendered photos of 2 megapixels are put into a folder that ``cubicfish shoot`` watches.

picture    seconds from the whole file to the page's picture of it, and to its corners
next pose  seconds to the next ghost board
CPU        of the process for one photo, all steps, the held-out error too

Then shoots with a film as camera are killed, each at a random moment after its first photo, and the
photos are counted that were told of and are not there whole.
"""

import argparse
import os
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import cv2
import numpy as np
from shooting import TARGET, Running, filmed, shooting
from synthetic import lens_of_size

from cubicfish import CubicfishError, Target, read_picture
from cubicfish.scene import Look, Scene

SCALE, PHOTOS = 1.7, 8


def cpu_of(running: Running) -> float:
    """CPU seconds of a process so far, user and system."""
    fields = Path(f"/proc/{running.process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def answers(folder: Path, count: int) -> None:
    """Put photos in one by one, and print how soon each step is told of."""
    lens = lens_of_size(SCALE)
    scene = Scene(target=Target.load(TARGET), lens=lens, image_size=lens.image_size)
    poses = {f"{number:02d}.jpg": pose for number, pose in enumerate(scene.choose_poses(count))}
    made = folder / "made"
    made.mkdir()
    for name, picture in scene.photos(poses, Look()):
        cv2.imwrite(str(made / name), picture)
    width, height = lens.image_size
    print(f"photos of {width * height / 1e6:.1f} Mpx\n")
    print(f"{'photo':<8}{'picture':>9}{'corners':>9}{'next pose':>11}{'CPU':>7}")
    rows = []
    with shooting(folder, "--goal", 0.001, "--jobs", 1) as running:
        for name in poses:
            told, before, ghost = running.told(), cpu_of(running), next(running.told())["ghost"]
            next(told)
            begun = time.monotonic()
            shutil.copy(made / name, folder / "photos" / name)
            at: dict[str, float] = {}
            for said in told:
                now = time.monotonic() - begun
                if said["last"]["name"] == name:
                    at.setdefault("picture", now)
                    if said["last"]["corners"]:
                        at.setdefault("corners", now)
                if "corners" in at and said["ghost"] != ghost:
                    at.setdefault("next", now)
                    break
            time.sleep(1.0)  # the held-out error comes last
            rows.append([at["picture"], at["corners"], at["next"], cpu_of(running) - before])
            print(f"{name:<8}{rows[-1][0]:>9.2f}{rows[-1][1]:>9.2f}{rows[-1][2]:>11.2f}"
                  f"{rows[-1][3]:>7.2f}", flush=True)  # fmt: skip
    middle, worst = np.median(rows, axis=0), np.max(rows, axis=0)
    for title, row in (("median", middle), ("worst", worst)):
        print(f"{title:<8}{row[0]:>9.2f}{row[1]:>9.2f}{row[2]:>11.2f}{row[3]:>7.2f}")


def kills(folder: Path, count: int) -> None:
    """Kill a shoot with a camera at random moments, and count what is lost."""
    rng, film = np.random.default_rng(0), filmed(folder / "film.mkv", seconds=1.2)
    told, lost, damaged, rest = 0, 0, 0, 0
    for number in range(count):
        own = folder / str(number)
        own.mkdir()
        with shooting(own, "--camera", film, page=False) as running:
            said = ""
            while not said.startswith("shoot_"):
                said = running.process.stdout.readline()
            time.sleep(float(rng.uniform(0.0, 8.0)))
            running.process.send_signal(signal.SIGKILL)
            said += running.process.communicate()[0]
        names = {one.partition(":")[0] for one in said.splitlines() if one.startswith("shoot_")}
        there = {path.name for path in (own / "photos").glob("*.png")}
        told, lost = told + len(names), lost + len(names - there)
        rest += len({*os.listdir(own / "photos")} - there)
        for name in there:
            try:
                read_picture(own / "photos" / name)
            except CubicfishError:
                damaged += 1
    print(f"\n{count} kills: {told} photos told of, {lost} lost, {damaged} damaged, "
          f"{rest} other files left")  # fmt: skip


def main() -> None:
    """Measure, kill, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--photos", type=int, default=PHOTOS)
    parser.add_argument("--kills", type=int, default=40)
    given = parser.parse_args()
    for part, amount in ((answers, given.photos), (kills, given.kills)):
        if amount:
            with tempfile.TemporaryDirectory() as name:
                part(Path(name), amount)


if __name__ == "__main__":
    main()
