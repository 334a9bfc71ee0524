"""Small inputs, so that most of a run is the program's start and its writing."""

import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from fault_process import PROGRAM, environment

PROJECT = Path(__file__).parents[3]
SAMPLE = PROJECT / "sample_data"
TARGET = SAMPLE / "target.yaml"
_IMAGES = ("corner_01.jpg", "corner_02.jpg", "corner_03.jpg")
_SCALE = 0.5


def photos(folder: Path, count: int = 4) -> None:
    """``photos/``, a half of the sample's size, and ``target.yaml``."""
    (folder / "photos").mkdir(parents=True)
    for path in sorted((SAMPLE / "photos").iterdir())[:count]:
        whole = cv2.imread(str(path))
        small = cv2.resize(whole, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_AREA)
        assert cv2.imwrite(str(folder / "photos" / path.name), small)
    shutil.copy(TARGET, folder)


def two_photos(folder: Path) -> None:
    """The least that is shared out to processes."""
    photos(folder, 2)


def corners(folder: Path) -> None:
    """``corners.csv`` of three photos of half size, and ``target.yaml``."""
    shutil.copy(TARGET, folder)
    lines = (SAMPLE / "true_corners.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[2:] if line.startswith(_IMAGES)]
    half = [
        ",".join((*row[:4], *(f"{_SCALE * (float(x) + 0.5) - 0.5:.6f}" for x in row[4:])))
        for row in rows
    ]
    head = ["# cubicfish corners 1, image_size 480x360", lines[1]]
    (folder / "corners.csv").write_text("\n".join([*head, *half]) + "\n")


def target(folder: Path) -> None:
    """``target.yaml`` alone."""
    shutil.copy(TARGET, folder)


def board(folder: Path) -> None:
    """``target.yaml`` of one small board."""
    (folder / "target.yaml").write_text(
        "units: mm\nboards:\n- {name: board, type: checkerboard, corners: [5, 4], square: 20}\n"
    )


def found_elsewhere(folder: Path) -> None:
    """``corners.vnl`` of one board, as another detector writes it, and its ``target.yaml``."""
    board(folder)
    grid = [(100 + 20 * column, 80 + 20 * row) for row in range(4) for column in range(5)]
    lines = [f"photo_{photo}.png {x + photo} {y} 0" for photo in range(40) for x, y in grid]
    (folder / "corners.vnl").write_text("\n".join(["# filename x y level", *lines]) + "\n")


def camera(folder: Path) -> None:
    """``calibration/camera.yaml`` of :func:`corners`."""
    (folder / "calibration").mkdir()
    (folder / "calibration" / "camera.yaml").write_bytes(_calibration()["camera.yaml"])


def foreign_camera(folder: Path) -> None:
    """``camchain.yaml`` and ``opencv.yaml``, as other tools write them."""
    camera(folder)
    for form, name in (("kalibr-ds", "camchain.yaml"), ("opencv", "opencv.yaml")):
        _run(folder, "export", "-m", "calibration/camera.yaml", "--to", form, "-o", name,
             "--max-error", "50")  # fmt: skip
    shutil.rmtree(folder / "calibration")


def points(folder: Path) -> None:
    """``points.csv`` and ``pixels.csv``, and a camera."""
    camera(folder)
    x, y = np.meshgrid(np.linspace(-1, 1, 100), np.linspace(-1, 1, 100))
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    np.savetxt(folder / "points.csv", rays, delimiter=",")
    np.savetxt(folder / "pixels.csv", 200 + 50 * rays[:, :2], delimiter=",")


def camera_and_corners(folder: Path) -> None:
    """A camera and what it was made from."""
    camera(folder)
    corners(folder)
    (folder / "corners.csv").rename(folder / "calibration" / "corners.csv")


def camera_and_photos(folder: Path) -> None:
    """A camera and five photos."""
    camera(folder)
    photos(folder, 5)


def camera_and_photo(folder: Path) -> None:
    """A camera and one photo."""
    camera(folder)
    photos(folder, 1)


def camera_and_pictures(folder: Path) -> None:
    """Formats that are written in different ways: 16 bits, transparency, TIFF."""
    camera_and_photo(folder)
    (photo,) = (folder / "photos").iterdir()
    grey = cv2.imread(str(photo), cv2.IMREAD_GRAYSCALE)
    photo.unlink()
    colour = np.dstack([grey, grey, grey, np.full_like(grey, 255)])
    for name, picture in (
        ("deep.png", grey.astype(np.uint16) * 257),
        ("see-through.png", colour),
        ("grey.tif", grey),
        ("grey.webp", colour[..., :3]),
    ):
        assert cv2.imwrite(str(folder / "photos" / name), picture)


def camera_and_video(folder: Path) -> None:
    """``drive.mp4`` of 30 frames, and a camera."""
    import av

    camera_and_photo(folder)
    (photo,) = (folder / "photos").iterdir()
    picture = cv2.imread(str(photo))
    with av.open(str(folder / "drive.mp4"), "w") as video:
        stream = video.add_stream("libx264", rate=10)
        stream.height, stream.width = picture.shape[:2]
        stream.pix_fmt = "yuv420p"
        for shift in range(30):
            frame = av.VideoFrame.from_ndarray(np.roll(picture, 4 * shift, axis=1), "bgr24")
            video.mux(stream.encode(frame))
        video.mux(stream.encode())
    shutil.rmtree(folder / "photos")


def older_calibration(folder: Path) -> None:
    """What an earlier calibration, of fewer photos and with a refined object, has left."""
    for name, content in _older_calibration().items():
        (folder / name).write_bytes(content)


@cache
def _calibration() -> dict[str, bytes]:
    return _calibrated(_IMAGES, "--no-report", "--refine-target", "off")


@cache
def _older_calibration() -> dict[str, bytes]:
    return _calibrated(_IMAGES[:2], "--refine-target", "shape")


def _calibrated(images: tuple[str, ...], *options: str) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        corners(folder)
        table = folder / "corners.csv"
        first, second, *rows = table.read_text().splitlines()
        chosen = [row for row in rows if row.startswith(images)]
        table.write_text("\n".join([first, second, *chosen]) + "\n")
        _run(folder, "calibrate", "corners.csv", "--target", "target.yaml", "--no-hold-out",
             "-o", "calibration", *options)  # fmt: skip
        return {path.name: path.read_bytes() for path in (folder / "calibration").iterdir()}


def _run(folder: Path, *args: str) -> None:
    done = subprocess.run(
        [*PROGRAM, *args], cwd=folder, env=environment(folder.parent), capture_output=True
    )
    assert done.returncode == 0, done.stderr.decode()
