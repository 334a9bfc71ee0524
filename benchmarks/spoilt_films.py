"""Whether spoilt frames are passed over: ``python benchmarks/spoilt_films.py DATA [NAME...]``.

DATA holds a folder a camera: images/ and target.yaml. Its photos become a film, each twice, with
the same blurred, streaked as by motion, and shifted between; `cubicfish frames` chooses of it, and
a row per camera says of how many photos a frame was chosen, and which spoilt ones were.
"""

import csv
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from cubicfish_cli.films.source import write_film
from cubicfish_cli.photos import find_photos

RATE = 10.0
KINDS = ("photo", "photo", "blurred", "streaked", "shifted", "shifted", "shifted")


def frames_of(photo: np.ndarray) -> Iterator[np.ndarray]:
    """A photo as :data:`KINDS` say, spoilt by shares of its width."""
    width = photo.shape[1]
    streak = np.zeros((width // 40 | 1,) * 2, np.float32)
    streak[len(streak) // 2] = 1 / len(streak)
    yield from (photo, photo)
    yield cv2.GaussianBlur(photo, (0, 0), width / 250)
    yield cv2.filter2D(photo, -1, streak)
    for share in (0.006, 0.012, 0.04):
        yield np.roll(photo, (round(share * width), round(share * width)), (0, 1))


def pictures(folder: Path) -> tuple[list[np.ndarray], list[str]]:
    """The photos of the size that most have, made even, and their names."""
    photos = [(photo.name, photo.read_grey()) for photo in find_photos([folder])]
    shape = Counter(picture.shape for _, picture in photos).most_common(1)[0][0]
    kept = [(name, picture) for name, picture in photos if picture.shape == shape]
    height, width = (side // 2 * 2 for side in shape)
    return [np.ascontiguousarray(one[:height, :width]).astype(np.uint8) for _, one in kept], [
        name for name, _ in kept
    ]


def main() -> None:
    data, *only = sys.argv[1:]
    print(f"{'camera':<20}{'photos':>7}{'chosen':>8}  spoilt ones, and copies")
    for camera in sorted(Path(data).iterdir()):
        if not (camera / "target.yaml").exists() or (only and camera.name not in only):
            continue
        photos, _ = pictures(camera / "images")
        with tempfile.TemporaryDirectory() as folder:
            film, out = Path(folder) / "film.mp4", Path(folder) / "chosen"
            size = (photos[0].shape[1], photos[0].shape[0])
            write_film(film, (frame for photo in photos for frame in frames_of(photo)), size, RATE)
            said = subprocess.run(
                [
                    *(sys.executable, "-m", "cubicfish_cli", "frames", film, "-o", out),
                    *("-t", camera / "target.yaml", "--no-cache", "-j", "1"),
                ],
                capture_output=True,
                text=True,
            )
            if said.returncode:
                print(f"{camera.name:<20}{len(photos):>7}  {said.stderr.splitlines()[-1]}")
                continue
            with (out / "frames.csv").open(encoding="utf-8") as file:
                next(file)
                rows = list(csv.DictReader(file))
        taken = [number for number, row in enumerate(rows) if row["chosen"] == "yes"]
        spoilt = Counter(
            KINDS[number % len(KINDS)] for number in taken if KINDS[number % len(KINDS)] != "photo"
        )
        copies = len(taken) - len({number // len(KINDS) for number in taken})
        print(
            f"{camera.name:<20}{len(photos):>7}{len(taken):>8}  {dict(spoilt)}, {copies} copies",
            flush=True,
        )


if __name__ == "__main__":
    main()
