"""What docs/use-it-in.md and docs/formats.md tell people to paste: it runs as it stands there."""

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from running import run_cli
from samples import SAMPLE

from cubicfish import load_camera

DOCS = Path(__file__).parents[2] / "docs"
Blocks = dict[str, list[tuple[str, str]]]
POINT = np.array([20.0, -10.0, 100.0])


def blocks(page: str) -> Blocks:
    """By their headings, the languages and texts of a page's code."""
    text = (DOCS / page).read_text(encoding="utf-8")
    parts = re.split(r"^## (.*)$", text, flags=re.MULTILINE)[1:]
    find = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
    return {head: find.findall(body) for head, body in zip(parts[::2], parts[1::2], strict=True)}


USES = blocks("use-it-in.md")
TEXTS = (text for _, text in blocks("formats.md")["Reading rays"])
READERS = dict(zip(("numpy", "torch", "c"), TEXTS, strict=True))


@pytest.fixture
def folder(calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where people paste: below it are a calibration and photos."""
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    record["pupil"] = {"travel": 3.0, "units": "mm"}
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "camera.yaml").write_text(yaml.safe_dump(record))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def code(head: str, language: str) -> str:
    """The one block of a language below a heading; commands of cubicfish are run first."""
    (text,) = (text for kind, text in USES[head] if kind == language)
    for line in (line for kind, text in USES[head] if kind == "sh" for line in text.splitlines()):
        if line.startswith("cubicfish "):
            run_cli(*line.split()[1:])
    return text


def ran(*command: object) -> list[float]:
    """The numbers that a program prints."""
    said = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr
    return [float(one) for one in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", said.stdout)]


def needs(program: str) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"there is no {program}")


def test_cpp(folder: Path) -> None:
    needs("g++")
    Path("main.cpp").write_text(code("C and C++", "cpp"))
    ran("g++", "-Wall", "-Wextra", "-Werror", "main.cpp")
    numbers = np.array(ran("./a.out"))
    camera = load_camera("calibration/camera.yaml").camera
    pixel = camera.project(POINT, near=True)
    np.testing.assert_allclose(numbers[:2], pixel, atol=1e-5)
    np.testing.assert_allclose(numbers[2:], camera.unproject(pixel), atol=1e-8)


def test_python(folder: Path) -> None:
    Path("use.py").write_text(code("Python without cubicfish", "python"))
    numbers = np.array(ran(sys.executable, "use.py"))
    rays = np.array([POINT, [100.0, 0.0, 50.0]])
    pixel = load_camera("calibration/camera.yaml").camera.project(rays)
    np.testing.assert_allclose(numbers[:4].reshape(2, 2), pixel, atol=1e-4)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    np.testing.assert_allclose(numbers[-6:].reshape(2, 3), rays, atol=1e-6)


def test_a_web_page(folder: Path) -> None:
    needs("node")
    page = code("A web page", "html")
    Path("page.mjs").write_text(re.findall(r'<script type="module">(.*)</script>', page, re.S)[0])
    numbers = ran("node", "page.mjs")
    pixel = load_camera("calibration/camera.yaml").camera.project(POINT, near=True)
    np.testing.assert_allclose(numbers, pixel, atol=1e-6)


def test_opencv_straightens_photos(folder: Path) -> None:
    photo = SAMPLE / "photos" / "corner_01.jpg"
    Path("photo.jpg").write_bytes(photo.read_bytes())
    run_cli("map", "calibration/undistort_map.npz")
    text, _ = (text for kind, text in USES["OpenCV"] if kind == "python")
    Path("use.py").write_text(text)
    ran(sys.executable, "use.py")
    run_cli("undistort", photo, "same.png")
    read = [cv2.imread(name, cv2.IMREAD_UNCHANGED) for name in ("flat.png", "same.png")]
    np.testing.assert_array_equal(*read)


def test_opencv_takes_the_nearest_lens(folder: Path) -> None:
    _, text = (text for kind, text in USES["OpenCV"] if kind == "python")
    (line,) = (text for kind, text in USES["OpenCV"] if kind == "sh")
    run_cli(*line.split()[1:])
    Path("use.py").write_text(text)
    numbers = np.array(ran(sys.executable, "use.py"))
    pixel = load_camera("calibration/camera.yaml").camera.project(POINT)
    np.testing.assert_allclose(numbers[:2], pixel, atol=1.0)
    np.testing.assert_allclose(numbers[2:], [0.2, -0.1], atol=1e-3)


@pytest.mark.slow
def test_blender(folder: Path) -> None:
    if find_spec("bpy") is None:
        pytest.skip("there is no bpy")
    Path("use.py").write_text(
        code("Blender", "python") + "print(f'{bpy.context.scene.camera.data.type}')\n"
    )
    said = subprocess.run([sys.executable, "use.py"], capture_output=True, text=True, check=True)
    assert "CUSTOM" in said.stdout


def test_colmap(folder: Path) -> None:
    (text,) = (text for _, text in USES["COLMAP"])
    Path("bin").mkdir()
    for name, does in (("colmap", 'echo "$@" >> said.txt'), ("cubicfish", "exit 0")):
        Path("bin", name).write_text(f"#!/bin/sh\n{does}\n")
        Path("bin", name).chmod(0o755)
    run_cli(*text.splitlines()[0].split()[1:])
    subprocess.run(["sh", "-ec", f"PATH=bin:$PATH\n{text}"], check=True)
    first = Path("said.txt").read_text().splitlines()[0].split()
    own = Path("cameras.txt").read_text().splitlines()[-1].split()
    assert first[first.index("--ImageReader.camera_model") + 1] == own[1]
    assert first[first.index("--ImageReader.camera_params") + 1].split(",") == own[4:]
    assert len(own) == 20


@pytest.mark.parametrize(("head", "lines"), [("ROS", 22), ("gsplat", 20), ("Blender", 12)])
def test_what_needs_more_compiles(head: str, lines: int) -> None:
    (text,) = (text for kind, text in USES[head] if kind == "python")
    compile(text, head, "exec")
    assert text.count("\n") <= lines


def test_ffmpeg(folder: Path) -> None:
    (text,) = (text for _, text in USES["ffmpeg"])
    first, second = text.splitlines()
    run_cli(*first.split()[1:])
    assert all(Path(name).exists() for name in re.findall(r"\S+\.pgm", second))


@pytest.fixture
def rays(folder: Path) -> np.ndarray:
    """Unit rays of a calibration whose grids are there, up to the end of its field."""
    run_cli("export", "--to", "rays", "-o", "left.rays.npz")
    camera = load_camera("calibration/camera.yaml").camera
    pixel = np.random.default_rng(0).uniform(0, np.array(camera.image_size) - 1, (4000, 2))
    rays = camera.unproject(pixel)
    return rays[np.isfinite(rays[:, 0])]


def test_rays_are_read_by_numpy(rays: np.ndarray) -> None:
    assert max(text.count("\n") for text in READERS.values()) <= 40
    names: dict = {}
    exec(READERS["numpy"], names)
    pixel = load_camera("calibration/camera.yaml").camera.project(rays)
    assert np.abs(names["project"](5 * rays) - pixel).max() < 0.001
    # A thousandth of a pixel is some millionths of a radian.
    np.testing.assert_allclose(names["unproject"](pixel), rays, atol=1e-5)


@pytest.mark.slow
def test_rays_are_read_by_torch(rays: np.ndarray) -> None:
    torch = pytest.importorskip("torch")
    Path("rays.py").write_text(READERS["torch"])
    (text,) = (text for kind, text in USES["A network"] if kind == "python")
    names: dict = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(".")
        exec(text, names)
    pixel = load_camera("calibration/camera.yaml").camera.project(rays)
    seen = names["project"](torch.as_tensor(rays))
    assert np.abs(seen.numpy() - pixel).max() < 0.001
    np.testing.assert_allclose(names["unproject"](torch.as_tensor(pixel)), rays, atol=1e-5)
    assert torch.isfinite(names["points"].grad).all()


def test_rays_are_read_by_c(rays: np.ndarray) -> None:
    needs("gcc")
    camera = dict(np.load("left.rays.npz"))
    camera["pixels"].tofile("pixels.f32")
    rows, columns, _ = camera["pixels"].shape
    x, y, step = camera["pixels_at"].tolist()
    main = f"""
    #include <stdio.h>
    int main(void) {{
      static float points[{2 * rows * columns}];
      const grid g = {{points, {columns}, {rows}, {x!r}, {y!r}, {step!r}}};
      double ray[3], pixel[2];
      FILE *file = fopen("pixels.f32", "rb");
      if (fread(points, sizeof(float), {2 * rows * columns}, file) == 0) return 1;
      while (scanf("%lf %lf %lf", ray, ray + 1, ray + 2) == 3) {{
        project(&g, ray, pixel);
        printf("%.9f %.9f\\n", pixel[0], pixel[1]);
      }}
      return 0;
    }}
    """
    Path("main.c").write_text(READERS["c"] + main)
    subprocess.run(["gcc", "-std=c99", "-Wall", "-Werror", "main.c", "-lm"], check=True)
    asked = "\n".join(" ".join(map(repr, ray)) for ray in rays.tolist())
    said = subprocess.run(["./a.out"], input=asked, capture_output=True, text=True, check=True)
    seen = np.array(said.stdout.split(), float).reshape(-1, 2)
    pixel = load_camera("calibration/camera.yaml").camera.project(rays)
    assert np.abs(seen - pixel).max() < 0.001
