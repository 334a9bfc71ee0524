"""How fast and how straight undistortion is, each figure against its peer in the same run.

    python benchmarks/undistort.py [map one batch memory video startup straight real] [--photos 500]

Without names everything is measured. Ratios are what counts: the peer runs turn by turn with
what is measured, so that other work on the machine falls on both.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # as the command line has it
    os.environ.setdefault(_threads, "1")

import cv2  # noqa: E402
import numpy as np  # noqa: E402

from cubicfish import CubicCamera, Run, UndistortMap, build_map, load_camera, undistort  # noqa: E402
from cubicfish.views import CentralView, ViewOptions  # noqa: E402
from cubicfish_cli.undistortion.batch import Job, write_many, write_one  # noqa: E402

HERE = Path(__file__).resolve().parent
SAMPLE = HERE.parent / "sample_data"
REAL = HERE.parents[1] / "shared" / "data" / "ov_cube"
CUBICFISH = [sys.executable, "-m", "cubicfish_cli"]
QUALITY = 92


def turn_by_turn(parts: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Median seconds of each part, run one after the other, again and again."""
    seconds: dict[str, list[float]] = {name: [] for name in parts}
    for number in range(rounds + 1):
        for name, run in parts.items():
            start = time.perf_counter()
            run()
            if number:  # the first round warms up
                seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def say(name: str, figure: float, limit: str = "") -> None:
    print(f"{name:<66}{figure:>9.3f}  {limit}", flush=True)


def calibrated(folder: Path, *args: object) -> Path:
    """The camera.yaml that ``cubicfish calibrate`` makes."""
    out = folder / "calibration"
    subprocess.run(
        [*CUBICFISH, "calibrate", *map(str, args), "-o", str(out), "--no-hold-out", "-q"],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return out / "camera.yaml"


def sample_camera(folder: Path) -> Path:
    """Calibrated from the sample's photos."""
    return calibrated(folder, SAMPLE / "photos", "--target", SAMPLE / "target.yaml")


def of_size(camera: CubicCamera, size: tuple[int, int]) -> CubicCamera:
    """The camera on a sensor of this size, cut to its shape."""
    scale = max(size[0] / camera.image_size[0], size[1] / camera.image_size[1])
    whole = camera.for_photos(tuple(round(s * scale) for s in camera.image_size))
    shift = np.eye(3)
    shift[:2, 2] = [-(w - s) / 2 for w, s in zip(whole.image_size, size, strict=True)]
    return CubicCamera(
        image_size=size,
        P=shift @ whole.P,
        max_angle_deg=whole.max_angle_deg,
        radial=whole.radial,
    )


def measure_map(camera: CubicCamera) -> None:
    for size, limit in (((1920, 1080), 0.6), ((3840, 2160), 0.8)):
        own = of_size(camera, size)
        focal = own.radial.fx
        lens = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1.0]])
        view = CentralView.with_field("perspective", 110, size)
        parts: dict[str, Callable[[], object]] = {
            "cv2": lambda lens=lens, own=own, view=view, size=size: (
                cv2.fisheye.initUndistortRectifyMap(
                    lens, own.radial.k, np.eye(3), view.camera_matrix, size, cv2.CV_32FC1
                )
            )
        }
        for kind in ViewOptions.KINDS[:-1]:  # a cube has several
            field = 110 if kind == "perspective" else 170
            other = CentralView.with_field(kind, field, size)
            parts[kind] = lambda own=own, other=other: build_map(own, other)
        seconds = turn_by_turn(parts, 9 if size[0] < 2000 else 5)
        say(
            f"map {size[0]}x{size[1]}: cv2.fisheye.initUndistortRectifyMap, ms",
            1e3 * seconds["cv2"],
        )
        for kind in ViewOptions.KINDS[:-1]:  # a cube has several
            wanted = f"(<= {limit})" if kind == "perspective" else ""
            say(f"  {kind}, times that", seconds[kind] / seconds["cv2"], wanted)


def photos(folder: Path, count: int, size: tuple[int, int]) -> list[Path]:
    """Photos with noise and detail, all different."""
    folder.mkdir(parents=True, exist_ok=True)
    source = cv2.imread(str(SAMPLE / "photos" / "corner_01.jpg"))
    source = cv2.resize(source, size, interpolation=cv2.INTER_CUBIC)
    paths = []
    for number in range(count):
        path = folder / f"{number:04}.jpg"
        picture = np.roll(source, 7 * number, axis=1)
        cv2.imwrite(str(path), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        paths.append(path)
    return paths


def plain(source: Path, out: Path, made: UndistortMap, options: list[int]) -> None:
    picture = cv2.imread(str(source))
    flat = cv2.remap(picture, made.map_x, made.map_y, cv2.INTER_LINEAR)
    cv2.imwrite(str(out), flat, options)


def ours(sources: list[Path], folder: Path, made: UndistortMap, workers: int) -> None:
    jobs = [Job(name=p.name, photos={"": p}, outputs={"": folder / p.name}) for p in sources]
    failures = write_many(
        jobs,
        partial(write_one, render=lambda job, photos: {"": undistort(photos[""], made)}),
        Run(jobs=workers, overwrite=True),
    )
    assert not failures, failures


def measure_one(camera: CubicCamera, folder: Path) -> None:
    size = (1920, 1080)
    made = build_map(of_size(camera, size), CentralView.with_field("perspective", 110, size))
    (jpeg,) = photos(folder / "one", 1, size)
    png = jpeg.with_suffix(".png")
    cv2.imwrite(str(png), cv2.imread(str(jpeg)))
    for source, options in ((jpeg, [cv2.IMWRITE_JPEG_QUALITY, QUALITY]), (png, [])):
        seconds = turn_by_turn(
            {
                "plain": lambda s=source, o=options: plain(s, folder / f"p{s.suffix}", made, o),
                "ours": lambda s=source: ours([s], folder / "one_out", made, 1),
            },
            15,
        )
        ratio = seconds["ours"] / seconds["plain"]
        say(f"one {source.suffix} of 1920x1080, times imread + remap + imwrite", ratio, "(<= 1.15)")


def measure_batch(camera: CubicCamera, folder: Path, count: int) -> None:
    size = (1920, 1080)
    made = build_map(of_size(camera, size), CentralView.with_field("perspective", 110, size))
    sources = photos(folder / "batch", count, size)
    options = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    out = folder / "batch_out"
    out.mkdir()
    # In parts, so that both see the same machine.
    parts = [sources[at : at + 25] for at in range(0, count, 25)]
    wall = {"plain": 0.0, "two": 0.0, "ours": 0.0}
    cpu = dict(wall)

    def loop(part: list[Path]) -> None:
        cv2.setNumThreads(1)
        for source in part:
            plain(source, out / source.name, made, options)
        cv2.setNumThreads(0)

    def two_bare_threads(part: list[Path]) -> None:
        cv2.setNumThreads(1)
        with ThreadPoolExecutor(2) as threads:
            list(threads.map(lambda s: plain(s, out / s.name, made, options), part))
        cv2.setNumThreads(0)

    runs: dict[str, Callable[[list[Path]], None]] = {
        "plain": loop,
        "two": two_bare_threads,
        "ours": lambda part: ours(part, folder / "batch_ours", made, 2),
    }
    for part in parts:
        for name, run in runs.items():
            start, busy = time.perf_counter(), time.process_time()
            run(part)
            wall[name] += time.perf_counter() - start
            cpu[name] += time.process_time() - busy
    say(
        f"batch of {count}, -j 2: times as fast as the plain loop",
        wall["plain"] / wall["ours"],
        "(>= 1.8 where two processors are free)",
    )
    say("  the same plain loop on two bare threads", wall["plain"] / wall["two"])
    say("  processor time, times that of the plain loop", cpu["ours"] / cpu["plain"])
    say("  the plain loop's share of one processor", cpu["plain"] / wall["plain"])


def peak_mb(args: list[str]) -> float:
    """Peak memory of a command, started by a small process: a fork counts its parent's."""
    launcher = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", launcher, *args], check=True, capture_output=True, text=True
    )
    return int(done.stdout) / 1024


def measure_memory(model: Path, folder: Path) -> None:
    photos(folder / "many", 1000, (960, 720))
    few = folder / "few"
    few.mkdir()
    for number in range(100):
        (few / f"{number:04}.jpg").symlink_to(folder / "many" / f"{number:04}.jpg")
    for source, out in ((few, "few_out"), (folder / "many", "many_out")):
        args = [
            *CUBICFISH,
            "undistort",
            str(source),
            str(folder / out),
            "-m",
            str(model),
            "-j",
            "2",
        ]
        say(f"memory for {len(list(source.iterdir()))} photos of 960x720, MB", peak_mb(args))


def measure_video(camera: CubicCamera, folder: Path) -> None:
    import av

    from cubicfish import Listener
    from cubicfish_cli.undistortion.video import DEFAULT_CRF, VideoViews

    size = (1920, 1080)
    view = CentralView.with_field("perspective", 110, size)
    views = VideoViews(of_size(camera, size), view, "linear", DEFAULT_CRF, Listener())
    source = folder / "in.mp4"
    still = photos(folder / "still", 1, (2200, 1300))[0]
    whole = cv2.cvtColor(cv2.imread(str(still)), cv2.COLOR_BGR2RGB)
    with av.open(str(source), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "18"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for number in range(60):
            part = np.ascontiguousarray(whole[number : number + 1080, 3 * number :][:, :1920])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(part, format="rgb24")))
        container.mux(stream.encode(None))

    def copy() -> None:
        """Decode and encode the same number of frames, undistorted ones."""
        with av.open(str(flat)) as given, av.open(str(folder / "copy.mp4"), "w") as taken:
            stream = given.streams.video[0]
            stream.thread_type = "AUTO"
            out = taken.add_stream("libx264", rate=30, options={"crf": "18"})
            out.width, out.height, out.pix_fmt = *size, "yuv420p"
            for frame in given.decode(stream):
                taken.mux(out.encode(frame))
            taken.mux(out.encode(None))

    flat = folder / "out.mp4"

    def undistort() -> None:
        job = Job(name="film", photos={"": source}, outputs={"": flat})
        assert views.write(job, overwrite=True) is None

    undistort()
    seconds = turn_by_turn({"copy": copy, "ours": undistort}, 3)
    say("video 1920x1080, frames per second", 60 / seconds["ours"])
    say(
        "  times the speed of decoding and encoding alone",
        seconds["copy"] / seconds["ours"],
        "(>= 0.8)",
    )


def measure_startup(model: Path, folder: Path) -> None:
    photo = SAMPLE / "photos" / "corner_01.jpg"
    args = [*CUBICFISH, "undistort", str(photo), str(folder / "s.jpg"), "-m", str(model)]
    args.append("--overwrite")
    wall, busy = [], []
    for _ in range(8):
        before, start = os.times(), time.perf_counter()
        subprocess.run(args, check=True, stdout=subprocess.DEVNULL)
        wall.append(time.perf_counter() - start)
        after = os.times()
        busy.append(
            after.children_user
            + after.children_system
            - before.children_user
            - before.children_system
        )
    say("start to end of one photo of 960x720, s: least", min(wall), "(<= 0.5)")
    say("  processor time, s: median", statistics.median(busy))


def bend_px(points: np.ndarray) -> float:
    """RMS distance of points (N, 2) from their best line."""
    centred = points - points.mean(axis=0)
    return float(np.linalg.svd(centred, compute_uv=False)[-1] / np.sqrt(len(points)))


def measure_straight(model: Path) -> None:
    """Straight lines of the scene, as the true lens of the sample sees them."""
    sys.path.insert(0, str(SAMPLE))
    from render_sample import true_lens

    camera, lens = load_camera(model).camera, true_lens()
    view = CentralView.with_field("perspective", 140, camera.image_size)
    rng = np.random.default_rng(0)
    bends, other = [], []
    reach = np.tan(np.radians(70)) * 0.9
    for _ in range(400):
        ends = rng.uniform(-reach, reach, (2, 2)) * [1, 0.75]
        along = ends[0] + np.linspace(0, 1, 60)[:, None] * (ends[1] - ends[0])
        pixel = lens.project(np.column_stack([along, np.ones(60)]))
        inside = ((pixel >= 0) & (pixel <= np.array(camera.image_size) - 1)).all(axis=1)
        for model_, values in ((camera, bends), (camera.radial, other)):
            flat = view.pixels(model_.unproject(pixel[inside]))
            flat = flat[np.isfinite(flat).all(axis=1)]
            if len(flat) > 20:
                values.append(bend_px(flat))
    scale = view.focal / camera.radial.fx
    say("straight lines of the sample's lens bend by, RMS px", rms(bends), "(<= 0.05)")
    say("  in pixels of the photo's scale", rms(bends) / scale)
    say("  its radial reference", rms(other))


def rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def measure_rendered(model: Path) -> None:
    """Edges of half planes, rendered by the sample's lens and found again in undistorted photos."""
    sys.path.insert(0, str(SAMPLE))
    from render_sample import true_lens

    camera, lens = load_camera(model).camera, true_lens()
    width, height = camera.image_size
    view = CentralView.with_field("perspective", 130, camera.image_size)
    steps = 4  # samples of each pixel, along each side
    x = (np.arange(steps * width) + 0.5) / steps - 0.5
    y = (np.arange(steps * height) + 0.5) / steps - 0.5
    rays = np.empty((len(y), len(x), 3), np.float32)
    for top in range(0, len(y), 100):
        pixel = np.stack(np.meshgrid(x, y[top : top + 100]), axis=-1)
        rays[top : top + 100] = lens.unproject(pixel)
    lenses = {
        "cubic": build_map(camera, view),
        "radial reference": build_map(_Radial(camera), view),
        "the true lens, which shows what measuring costs": build_map(lens, view),
    }
    bends: dict[str, list[float]] = {name: [] for name in lenses}
    rng = np.random.default_rng(1)
    for _ in range(30):
        angle = rng.uniform(0, np.pi)
        normal = np.array([np.cos(angle), np.sin(angle)])
        shift = rng.uniform(-1.2, 1.2)
        with np.errstate(invalid="ignore"):
            side = rays[..., :2] @ normal.astype(np.float32) - np.float32(shift) * rays[..., 2]
            light = np.where((side > 0) & (rays[..., 2] > 0), 220, 30)
        photo = light.reshape(height, steps, width, steps).mean(axis=(1, 3)).astype(np.float32)
        photo = cv2.GaussianBlur(photo, (0, 0), 1.0)  # no lens is sharper
        for name, made in lenses.items():
            flat = cv2.remap(photo, made.map_x, made.map_y, cv2.INTER_CUBIC)
            points = edge(flat, made.valid, view, normal, shift)
            if len(points) > 40:
                bends[name].append(bend_px(points))
    for name, values in bends.items():
        limit = "(<= 0.05)" if name == "cubic" else ""
        say(
            f"rendered edges of {len(values)} half planes, {name}: bend, RMS px", rms(values), limit
        )


class _Radial:
    """The reference as a camera with a field."""

    def __init__(self, camera: CubicCamera) -> None:
        self.image_size, self.max_angle_deg = camera.image_size, camera.max_angle_deg
        self.project = camera.radial.project


def edge(
    flat: np.ndarray, valid: np.ndarray, view: CentralView, normal: np.ndarray, shift: float
) -> np.ndarray:
    """Where an undistorted photo crosses from dark to light along a line's normals: (N, 2)."""
    foot = np.array(view.middle) + view.focal * shift * normal
    along = np.array([-normal[1], normal[0]])
    reach = np.arange(-1000.0, 1000.0, 2.0)
    offset = np.arange(-16, 16.01, 0.25)
    place = foot + reach[:, None, None] * along + offset[:, None] * normal
    place = place.astype(np.float32)
    level = cv2.remap(flat, place, None, cv2.INTER_CUBIC)
    inside = cv2.remap(valid.astype(np.float32), place, None, cv2.INTER_LINEAR)
    good = (inside > 0.999).all(axis=1) & (level[:, 0] < 40) & (level[:, -1] > 210)
    # The middle of a blurred step, by its moment: the mean place of the change.
    share = (level[good] - 30) / 190
    middle = offset[-1] - np.trapezoid(share, offset, axis=1)
    return foot + reach[good][:, None] * along + middle[:, None] * normal


def rows_of(
    points: np.ndarray, board: np.ndarray, row: np.ndarray, column: np.ndarray
) -> list[float]:
    """The bend of each row and each column of five corners or more."""
    bends = []
    good = np.isfinite(points).all(axis=1)
    for line in (row, column):
        for key in sorted(set(zip(board[good].tolist(), line[good].tolist(), strict=True))):
            own = good & (board == key[0]) & (line == key[1])
            if own.sum() >= 5:
                bends.append(bend_px(points[own]))
    return bends


def measure_real(folder: Path) -> None:
    """Rows of board corners of real photos, undistorted by each lens."""
    if not REAL.exists():
        print("real photos are not there: skipped")
        return
    from cubicfish import Target, load_corners

    target = Target.load(REAL / "target.yaml")
    corners = load_corners(REAL / "reference_corners.csv", target)
    own = folder / "real"
    own.mkdir()
    camera = load_camera(
        calibrated(own, REAL / "reference_corners.csv", "--target", REAL / "target.yaml")
    ).camera
    for field in (100, 130, 150):
        view = CentralView.with_field("perspective", field, camera.image_size)
        for name, lens in (("cubic", camera), ("radial reference", camera.radial)):
            flat = view.pixels(lens.unproject(corners.pixel))
            width, height = view.size
            with np.errstate(invalid="ignore"):
                inside = ((flat >= 0) & (flat <= [width - 1, height - 1])).all(axis=1)
            flat[~inside] = np.nan
            line = corners.board * 10_000 + corners.image
            bends = rows_of(flat, line, corners.row, corners.column)
            scale = view.focal / camera.radial.fx
            say(
                f"real corners, {field}° view, {name}: {len(bends)} rows bend by, RMS px",
                rms(bends) / scale,
                "in the photo's scale",
            )


def main() -> None:
    names = ("map", "one", "batch", "memory", "video", "startup", "straight", "real")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=[*names, []], help="what to measure")
    parser.add_argument("--photos", type=int, default=500, help="of the batch")
    given = parser.parse_args()
    wanted = given.names or names
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        model = sample_camera(folder)
        camera = load_camera(model).camera
        runs: dict[str, Callable[[], None]] = {
            "map": lambda: measure_map(camera),
            "one": lambda: measure_one(camera, folder),
            "batch": lambda: measure_batch(camera, folder, given.photos),
            "memory": lambda: measure_memory(model, folder),
            "video": lambda: measure_video(camera, folder),
            "startup": lambda: measure_startup(model, folder),
            "straight": lambda: (measure_straight(model), measure_rendered(model))[0],
            "real": lambda: measure_real(folder),
        }
        for name in wanted:
            runs[name]()


if __name__ == "__main__":
    main()
