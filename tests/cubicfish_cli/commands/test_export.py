"""Cameras for other tools and from them, read back by the tools or by their formulas."""

import json
import re
from pathlib import Path
from pkgutil import resolve_name

import cv2
import numpy as np
import pytest
import yaml
from running import Run

from cubicfish import FitError, load_camera
from cubicfish.geometry import inside_polygon
from cubicfish_cli.commands.export import FORMATS
from cubicfish_cli.commands.exporting import export_camera
from cubicfish_cli.extension_guard import (
    camera_formats,
    read_formats,
    written_formats,
)
from cubicfish_cli.words.export import printed, round_up

WRITTEN = written_formats()

# These are not read.
NOT_READ = {"anipose", "anipose-pinhole", "ftheta", "fisheye624"}
NOT_READ |= {name for name, one in WRITTEN.items() if one.exact}
LENS_FORMATS = sorted({*WRITTEN} - NOT_READ)


@pytest.fixture(scope="module")
def rays(calibrated: Path) -> np.ndarray:
    camera = load_camera(calibrated / "camera.yaml").camera
    width, height = camera.image_size
    grid = np.stack(np.meshgrid(np.linspace(0, width - 1, 60), np.linspace(0, height - 1, 45)), -1)
    rays = camera.unproject(grid.reshape(-1, 2))
    return rays[np.isfinite(rays[:, 0])]


def exported(run: Run, calibrated: Path, path: Path, name: str) -> dict:
    said = run(
        "export", "--to", name, "-m", calibrated / "camera.yaml", "-o", path,
        "--max-error", 3, "--json",
    )  # fmt: skip
    return json.loads(said.stdout)


def stated_px(record: dict) -> float:
    """The largest error that was stated, wherever in the field."""
    return max(record["max_px"], record.get("beyond", record)["max_px"])


def largest_px(pixel: np.ndarray, rays: np.ndarray, calibrated: Path) -> float:
    camera = load_camera(calibrated / "camera.yaml").camera
    return float(np.linalg.norm(pixel - camera.project(rays), axis=1).max())


def kannala_brandt(points, fx, fy, cx, cy, k):
    rho = np.hypot(points[:, 0], points[:, 1])
    theta = np.arctan2(rho, points[:, 2])
    bent = theta * (1 + sum(value * theta ** (2 * n + 2) for n, value in enumerate(k)))
    scale = np.divide(bent, rho, out=np.ones_like(rho), where=rho > 1e-12)
    return points[:, :2] * scale[:, None] * [fx, fy] + [cx, cy]


def test_the_commands_know_the_formats_that_there_are(run: Run):
    """All that the table names is there."""
    for one in camera_formats():
        places = [one.read, one.write, one.write_rig, one.looks_like, one.binary_looks_like]
        places += [how["lens"] for how in one.written.values() if not one.exact]
        assert all(callable(resolve_name(place)) for place in places if place)
        assert one.written or one.read
        assert bool(one.written) == bool(one.write) == bool(one.file_name)
        assert bool(one.read) == bool(one.reads) == bool(one.marks)
        assert bool(one.write_rig) == bool(one.rig_name)
    for page, names in (
        (run("export", "--help"), {*WRITTEN, "maps"}),
        (run("import", "--help"), set(read_formats())),
    ):
        assert {name for name in names if name in page.stdout} == names


@pytest.mark.slow
def test_opencv_reads_it_and_projects_the_same(run, calibrated, tmp_path, rays):
    path = tmp_path / "camera.yaml"
    record = exported(run, calibrated, path, "opencv")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    d = storage.getNode("distortion_coefficients").mat()
    assert storage.getNode("image_width").real() == 960
    assert storage.getNode("model").string() == "fisheye"
    storage.release()
    front = rays[rays[:, 2] > 0.1]  # cv2.fisheye divides by z
    turned = front @ np.array(record["lens_from_camera"]).T
    pixel, _ = cv2.fisheye.projectPoints(turned[:, None], np.zeros(3), np.zeros(3), matrix, d)
    assert largest_px(pixel[:, 0], front, calibrated) <= stated_px(record) * 1.02
    text = path.read_text()
    assert f"RMS {record['rms_px']:.4f} px, largest {record['max_px']:.4f} px" in text


@pytest.mark.slow
def test_ros_holds_the_same_lens(run, calibrated, tmp_path, rays):
    path = tmp_path / "camera_info.yaml"
    record = exported(run, calibrated, path, "ros")
    info = yaml.safe_load(path.read_text())
    assert (info["image_width"], info["image_height"]) == (960, 720)
    assert info["distortion_model"] == "equidistant"
    for key, rows, columns in (
        ("camera_matrix", 3, 3), ("distortion_coefficients", 1, 4),
        ("rectification_matrix", 3, 3), ("projection_matrix", 3, 4),
    ):  # fmt: skip
        assert (info[key]["rows"], info[key]["cols"]) == (rows, columns)
        assert len(info[key]["data"]) == rows * columns
    fx, _, cx, _, fy, cy = info["camera_matrix"]["data"][:6]
    turned = rays @ np.array(record["lens_from_camera"]).T
    pixel = kannala_brandt(turned, fx, fy, cx, cy, info["distortion_coefficients"]["data"])
    assert largest_px(pixel, rays, calibrated) <= stated_px(record) * 1.02


def project_kalibr(cam: dict, points: np.ndarray) -> np.ndarray:
    """Kalibr's projections, from the papers that its wiki names."""
    values, kind = cam["intrinsics"], cam["camera_model"]
    x, y, z = points.T
    r2 = x * x + y * y
    if kind == "pinhole":
        return kannala_brandt(points, *values, cam["distortion_coeffs"])
    core = values[-4:]
    if kind == "ds":
        xi, alpha = values[:2]
        d1 = np.sqrt(r2 + z * z)
        d2 = np.sqrt(r2 + (xi * d1 + z) ** 2)
        plane = points[:, :2] / (alpha * d2 + (1 - alpha) * (xi * d1 + z))[:, None]
    else:
        plane = points[:, :2] / (z + values[0] * np.sqrt(r2 + z * z))[:, None]
        k1, k2, p1, p2 = cam["distortion_coeffs"]
        u, v = plane.T
        s = u * u + v * v
        radial = 1 + k1 * s + k2 * s * s
        plane = np.stack(
            [u * radial + 2 * p1 * u * v + p2 * (s + 2 * u * u),
             v * radial + p1 * (s + 2 * v * v) + 2 * p2 * u * v], axis=-1,
        )  # fmt: skip
    return plane * core[:2] + core[2:]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lens", "kind", "distortion"),
    [("pinhole-equi", "pinhole", "equidistant"), ("omni", "omni", "radtan"),
     ("ds", "ds", "none")],
)  # fmt: skip
def test_kalibr_holds_the_same_lens(run, calibrated, tmp_path, rays, lens, kind, distortion):
    path = tmp_path / "camchain.yaml"
    record = exported(run, calibrated, path, f"kalibr-{lens}")
    cam = yaml.safe_load(path.read_text())["cam0"]
    assert (cam["camera_model"], cam["distortion_model"]) == (kind, distortion)
    assert all(isinstance(value, float) for value in cam["intrinsics"])
    assert cam["resolution"] == [960, 720]
    assert cam["rostopic"].startswith("/")
    turned = rays @ np.array(record["lens_from_camera"]).T
    pixel = project_kalibr(cam, turned)
    assert largest_px(pixel, rays, calibrated) <= stated_px(record) * 1.02


@pytest.mark.slow
def test_colmap_reads_it_and_projects_the_same(run, calibrated, tmp_path, rays):
    pycolmap = pytest.importorskip("pycolmap")
    record = exported(run, calibrated, tmp_path / "cameras.txt", "colmap")
    (tmp_path / "images.txt").write_text("")
    (tmp_path / "points3D.txt").write_text("")
    line = (tmp_path / "cameras.txt").read_text().splitlines()[-1].split()
    camera = pycolmap.Camera(
        model=line[1], width=int(line[2]), height=int(line[3]), params=[float(v) for v in line[4:]]
    )
    front = rays[rays[:, 2] > 0.1]
    turned = front @ np.array(record["lens_from_camera"]).T
    pixel = np.asarray(camera.img_from_cam(turned))
    # Its pixel (0, 0) is the corner of the first pixel.
    assert largest_px(pixel - 0.5, front, calibrated) <= stated_px(record) * 1.02


def test_nerfstudio_holds_lens_and_poses(run, calibrated, tmp_path, rays):
    path = tmp_path / "transforms.json"
    record = exported(run, calibrated, path, "nerfstudio")
    data = json.loads(path.read_text())
    assert (data["camera_model"], data["w"], data["h"]) == ("OPENCV_FISHEYE", 960, 720)
    k = [data[f"k{index}"] for index in (1, 2, 3, 4)]
    core = [data[key] for key in ("fl_x", "fl_y", "cx", "cy")]
    turn = np.array(record["lens_from_camera"])
    pixel = kannala_brandt(rays @ turn.T, *core, k) - 0.5  # its pixel centres are at halves
    assert largest_px(pixel, rays, calibrated) <= 1.02 * stated_px(record)
    # A world point projects to the same pixel by the frame's matrix as by camera.yaml's pose.
    loaded = load_camera(calibrated / "camera.yaml")
    row = loaded.fit.per_image[0]
    frame = next(f for f in data["frames"] if f["file_path"] == row.image)
    vector = np.array(row.camera_from_world.rotation_vector)
    rotation = cv2.Rodrigues(vector)[0]
    world = np.array([[60.0, 70.0, 40.0], [200.0, 30.0, 10.0]])
    seen = world @ rotation.T + row.camera_from_world.translation
    camera_from_world = np.linalg.inv(np.array(frame["transform_matrix"]))
    theirs = world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    theirs = theirs * [1, -1, -1]  # y up, view along -z
    np.testing.assert_allclose(theirs, seen @ turn.T, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", LENS_FORMATS)
def test_what_is_written_is_read_as_the_same_lens(run, calibrated, tmp_path, rays, name):
    path, back = tmp_path / "file.txt", tmp_path / "back" / "camera.yaml"
    record = exported(run, calibrated, path, name)
    said = json.loads(run("import", path, "-o", back, "--json").stdout)
    assert said["format"] == name.split("-")[0]
    assert said["max_px"] < 0.15
    made = load_camera(back)
    assert made.camera.image_size == (960, 720)
    assert made.made_by["inputs"][0]["file"] == str(path)
    pixel = made.camera.project(rays @ np.array(record["lens_from_camera"]).T)
    common = np.isfinite(pixel[:, 0])
    assert common.mean() > 0.9
    largest = largest_px(pixel[common], rays[common], calibrated)
    assert largest <= stated_px(record) + said["max_px"] + 0.02


@pytest.mark.slow
def test_an_imported_camera_serves_the_other_commands(run, calibrated, tmp_path, monkeypatch):
    exported(run, calibrated, tmp_path / "lens.cameramodel", "mrcal")
    monkeypatch.chdir(tmp_path)
    run("import", "lens.cameramodel")
    photo = next(iter(sorted((Path(__file__).parents[3] / "sample_data" / "photos").iterdir())))
    run("undistort", photo, "flat.png", "--size", "64x48")
    assert (tmp_path / "flat.png").stat().st_size > 1000
    said = run("compare", calibrated / "camera.yaml", "calibration/camera.yaml", "--json")
    assert json.loads(said.stdout)["rms_px"] < 0.02


@pytest.mark.slow
def test_a_lens_that_is_not_near_enough_is_refused(run, calibrated, tmp_path):
    path = tmp_path / "c.yaml"
    said = run(
        "export", "--to", "opencv", "-m", calibrated / "camera.yaml", "-o", path,
        "--max-error", 0.01, code=1,
    ).stderr  # fmt: skip
    assert "the lens of opencv misses the camera by up to" in said
    assert "more than the 0.01 px of --max-error: " in said
    assert "or take another format: " in said
    assert "maps lose nothing" in said
    assert not path.exists()
    enough = said.partition("--max-error ")[2].split()[0]
    assert len(enough.replace(".", "").lstrip("0")) <= 2
    run("export", "--to", "opencv", "-m", calibrated / "camera.yaml", "-o", path,
        "--max-error", enough)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "error"), [("opencv", 0.3), ("kalibr-ds", 0.3), ("ocamcalib", 0.1)]
)
def test_what_is_said_to_be_near_enough_within_an_angle_is(calibrated, name, error):
    camera = load_camera(calibrated / "camera.yaml")
    with pytest.raises(FitError, match="--max-angle ") as refused:
        export_camera(camera, name, max_error=error)
    angle = float(str(refused.value).partition("--max-angle ")[2].split()[0])
    export_camera(camera, name, max_error=error, max_angle_deg=angle)


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (1.7672, "1.8"),
        (0.50001, "0.51"),
        (12.3, "13"),
        (99.5, "100"),
        (0.0123, "0.013"),
        (2.0, "2"),
    ],
)
def test_the_error_that_would_pass_is_short_and_no_less(value, written):
    assert round_up(value) == written
    assert float(written) >= value


def test_the_help_lists_every_format_and_fits_a_terminal(run):
    lines = run("export", "--help").stdout.splitlines()
    assert "  --to FORMAT" in run("export", "--help").stdout
    assert max(map(len, lines)) <= 80
    listed = [line.split()[0] for line in lines if re.match(r"  [a-z0-9-]+  +[^ ]", line)]
    assert [name for name in listed if name in FORMATS] == list(FORMATS)
    kinds = {line.split()[0]: line for line in lines if line.strip()}
    for name, made in WRITTEN.items():
        file = made.file_name
        suffix = Path(file).suffix
        assert suffix.lstrip(".") in kinds[name].lower()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "other"),
    [("colmap", "colmap-rad-tan-thin-prism-fisheye"), ("kalibr-ds", "kalibr-omni")],
)
def test_a_nearer_format_of_the_same_tool_is_named(run, calibrated, tmp_path, name, other):
    args = ["export", "-m", calibrated / "camera.yaml", "-o", tmp_path / "c", "--max-error", 0.01]
    assert f"another format: {other} loses 0.0" in run(*args, "--to", name, code=1).stderr
    assert re.search("another format: [a-z, ]+ lose", run(*args, "--to", other, code=1).stderr)


@pytest.fixture(scope="module")
def known_to_60(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibration as if corners had reached 60° only."""
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    record["fit"]["covered_deg"] = 60.0
    path = tmp_path_factory.mktemp("known") / "camera.yaml"
    path.write_text(yaml.safe_dump(record))
    return path


@pytest.mark.slow
def test_the_gate_is_where_corners_were(run, known_to_60, tmp_path):
    args = ["export", "--to", "kalibr-ds", "-m", known_to_60]
    path = tmp_path / "a"
    record = json.loads(run(*args, "-o", path, "--max-error", 9, "--json").stdout)
    beyond = record["beyond"]
    assert 59 < record["max_angle_deg"] <= 60 == round(beyond["from_deg"])
    assert beyond["to_deg"] > 80
    assert max(ring["to_deg"] for ring in record["by_angle"]) == 60
    assert 1.05 * record["max_px"] < beyond["max_px"]
    between = (record["max_px"] + beyond["max_px"]) / 2
    text = path.read_text()
    assert f"up to {record['max_angle_deg']:.1f} degrees" in text
    assert f"where no corner was: RMS {beyond['rms_px']:.4f} px" in text
    said = run(*args, "-o", tmp_path / "b", "--max-error", between)
    assert f"{beyond['to_deg']:.1f} degrees, where no corner was: RMS" in said.stdout
    assert "warning: beyond 60.0°, where no corner was, RMS" in said.stderr
    assert "warning" not in run(*args, "-o", tmp_path / "c", "--max-error", 9).stderr
    run(*args, "-o", tmp_path / "d", "--max-error", 0.9 * record["max_px"], code=1)
    assert not (tmp_path / "d").exists()


@pytest.mark.slow
@pytest.mark.parametrize("covered", [None, "far", -3, 170.0])
def test_where_no_file_says_how_far_corners_reached_the_field_counts(
    run, calibrated, tmp_path, covered
):
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    record["fit"]["covered_deg"] = covered
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(record))
    said = run(
        "export", "--to", "colmap", "-m", path, "-o", tmp_path / "a", "--max-error", 3, "--json"
    )
    figures = json.loads(said.stdout)
    assert "beyond" not in figures
    assert figures["max_angle_deg"] > 0.95 * record["max_angle_deg"]


@pytest.mark.slow
def test_readers_that_see_nothing_behind_are_named(run, calibrated, tmp_path):
    args = ["export", "-m", calibrated / "camera.yaml", "--max-error", 3]
    lines = "itself sees nothing at 90 degrees"
    behind = load_camera(calibrated / "camera.yaml").camera.max_angle_deg > 90
    assert (lines in run(*args, "--to", "colmap", "-o", tmp_path / "a").stdout) == behind
    front = run(*args, "--to", "colmap", "-o", tmp_path / "b", "--max-angle", 80).stdout
    assert lines not in front
    assert lines not in run(*args, "--to", "kalibr-ds", "-o", tmp_path / "c").stdout


@pytest.mark.slow
def test_less_of_the_field_is_met_more_nearly(run, calibrated, tmp_path):
    args = ["export", "--to", "kalibr-ds", "-m", calibrated / "camera.yaml", "--max-error", 3]
    wide = json.loads(run(*args, "-o", tmp_path / "a", "--json").stdout)
    narrow = json.loads(run(*args, "-o", tmp_path / "b", "--max-angle", 50, "--json").stdout)
    assert narrow["max_angle_deg"] <= 50
    assert narrow["max_px"] < wide["max_px"]


def test_maps_are_written_too(run, calibrated, tmp_path):
    run("export", "--to", "maps", "-m", calibrated / "camera.yaml", "-o", tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz") as data:
        assert data["map_x"].dtype == np.float32


PINHOLE = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [400.0, 0.0, 320.5, 0.0, 401.0, 239.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.001, -0.0005, 0.0]}
"""


@pytest.mark.slow
def test_a_pinhole_lens_becomes_a_cubic_camera(run, tmp_path):
    path, back = tmp_path / "info.yaml", tmp_path / "camera.yaml"
    path.write_text(PINHOLE)
    said = json.loads(run("import", path, "-o", back, "--json").stdout)
    assert said["format"] == "ros"
    assert said["max_px"] < 0.05
    camera = load_camera(back).camera
    rays = np.array([[0.1, 0.2, 1.0], [-0.5, 0.3, 1.0], [0.0, 0.0, 1.0]])
    matrix = np.array([[400.0, 0, 320.5], [0, 401.0, 239.0], [0, 0, 1]])
    d = np.array([-0.2, 0.05, 0.001, -0.0005, 0.0])
    pixel, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, d)
    np.testing.assert_allclose(camera.project(rays), pixel[:, 0], atol=0.05)


CHAIN = """cam0:
  camera_model: {}
  distortion_model: {}
  distortion_coeffs: [-0.2, 0.05, 0.001, -0.0005]
  intrinsics: [400.0, 401.0, 320.5, 239.0]
  resolution: [640, 480]
"""


@pytest.mark.slow
def test_kalibrs_pinhole_becomes_the_same_cubic_camera(run, tmp_path):
    (tmp_path / "info.yaml").write_text(PINHOLE)
    (tmp_path / "chain.yaml").write_text(CHAIN.format("pinhole", "radtan"))
    cameras = []
    for name in ("info", "chain"):
        path = tmp_path / f"{name}.camera.yaml"
        said = run("import", tmp_path / f"{name}.yaml", "-o", path).stdout
        assert "conversion error: RMS 0.0" in said
        cameras.append(load_camera(path).camera)
    np.testing.assert_allclose(cameras[0].P, cameras[1].P, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello", "no format that is known"),
        (" \n", "is empty: name the file that the other tool wrote"),
        ("cubicfish: 2\nP: []\n", "is a camera.yaml of cubicfish already: use it as it is"),
        (PINHOLE.replace("640", "-3"), "image_width and image_height must be"),
        (PINHOLE.replace("400.0", "0.0"), "was not calibrated"),
        (PINHOLE.replace("400.0", ".nan"), "camera_matrix.data must hold 9 finite numbers"),
        (
            PINHOLE.replace("plumb_bob", "magic"),
            "distortion_model 'magic' is no lens that is known here",
        ),
        (PINHOLE.replace("plumb_bob", "[1]"), "is no lens that is known here"),
        (CHAIN.format("pinhole", "rational"), "'pinhole-rational' is no lens that is known here"),
        (CHAIN.format("mei", "none"), "cam0.distortion_model 'mei-none' is no lens that is known"),
        (
            '{"fl_x": 1, "camera_model": "X"}',
            "'X' is not known: OPENCV, OPENCV_FISHEYE, FISHEYE624",
        ),
        ('{"fl_x": 1, "fl_x": 2}', "the key 'fl_x' is there twice"),
        (
            "%YAML:1.0\n---\nK: [1, 0, 2, 0, 1, 2, 0, 0, 1]\nD: [1, 2, 3, 4]\nimage_width: 9\n"
            "image_height: 9\n",
            "a fisheye's or a pinhole's",
        ),
        ("cam0:\n  camera_model: [1]\n  intrinsics: []\n  resolution: []\n", "'-' is no lens that"),
        (PINHOLE.replace("data: [-0.2,", "data: [-0.2, 1.0, 2.0,"), "must hold 0 or 1 or 2"),
        ("# CAMERA_ID\n1 OPENCV_FISHEYE 640 480 1 2\n", "FISHEYE must hold 8"),
        ("# CAMERA_ID\n1 NONE 640 480 1 2\n", "'NONE' is not known here"),
        ("# CAMERA_ID\n1 PINHOLE 6 4 1 1 1 1\n2 PINHOLE 6 4 1 1 1 1\n", "--camera: 1, 2"),
        ('{"fl_x": 1e999}', "must hold 1 finite numbers"),
        ("cam0:\n  camera_model: x\n  intrinsics: []\n  resolution: []\n", "'x-' is no lens that"),
        ("%YAML:1.0\n---\nK: !!opencv-matrix\n  data: [1]\n", "K must hold 9"),
    ],
)
def test_files_that_are_none_are_refused_in_a_line(run, tmp_path, text, message):
    path = tmp_path / "file"
    path.write_text(text)
    said = run("import", path, "-o", tmp_path / "c.yaml", code=1).stderr
    assert said.startswith("Error: ")
    assert message in said
    assert said.count("\n") == 1
    assert not (tmp_path / "c.yaml").exists()


FISHEYE = """image_width: {width}
image_height: 480
camera_matrix: {{rows: 3, cols: 3, data: [{f}, 0.0, 320.5, 0.0, {f}, 239.0, 0.0, 0.0, 1.0]}}
distortion_model: equidistant
distortion_coefficients: {{rows: 1, cols: 4, data: [{k1}, 0.0, 0.0, 0.0]}}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lens", "options", "ended_by", "words"),
    [
        # θ - 0.15 θ³ grows up to 85.4°, where it is 198 px from the centre.
        ({"f": 200, "k1": -0.15}, [], "fold", "since the lens folds at 85."),
        ({"f": 300, "k1": -0.01}, [], "photo", "all that the lens shows in the photo"),
        ({"f": 100, "k1": -0.01}, [], "angle", "cut at 110.0°, which few lenses see beyond"),
        ({"f": 300, "k1": 0}, ["--max-angle", 40], "angle", "cut at 40.0°, the --max-angle given"),
    ],
)
def test_what_ends_an_imported_field_is_said(run, tmp_path, lens, options, ended_by, words):
    (tmp_path / "info.yaml").write_text(FISHEYE.format(width=640, **lens))
    args = ["import", tmp_path / "info.yaml", *options]
    said = run(*args, "-o", tmp_path / "a.yaml").stdout
    assert words in said
    assert said.count("\n") == 3
    assert ("does not say how far" in said) == (not options)
    record = json.loads(run(*args, "-o", tmp_path / "b.yaml", "--json").stdout)
    assert record["field_ended_by"] == ended_by
    assert (record["fold_deg"] is not None) == (ended_by == "fold")
    made = load_camera(tmp_path / "b.yaml")
    assert made.camera.max_angle_deg == pytest.approx(record["trusted_deg"])
    assert made.made_by["conversion"]["field_ended_by"] == ended_by


@pytest.mark.slow
def test_the_region_of_a_file_ends_the_field(run, calibrated, tmp_path):
    exported(run, calibrated, tmp_path / "lens", "mrcal")
    said = run("import", tmp_path / "lens", "-o", tmp_path / "camera.yaml").stdout
    assert "as far as the file says that the lens is valid" in said


def test_inside_an_outline():
    outline = np.array([[0, 0], [10, 0], [10, 10], [5, 3], [0, 10]], float)
    pixel = np.array([[5, 1], [5, 5], [1, 7], [9, 7], [-1, 5], [np.nan, 1], [11, 0]])
    np.testing.assert_array_equal(
        inside_polygon(pixel, outline), [True, False, True, True, False, False, False]
    )


def test_what_the_file_does_not_hold_is_printed() -> None:
    line = "the frame is turned by 0.033 degrees; lens_from_camera: 0.99 -0.01"
    assert printed(line, "a file\n", f"# {line}\n").endswith(": lens_from_camera is in the file")
    assert printed(line, "a file without comments") == line
    assert printed("conversion error: RMS 0.1 px", "") == "conversion error: RMS 0.1 px"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["opencv", "nerfstudio", "kalibr-pinhole-equi"])
def test_own_exports_come_back_with_the_field_they_had(
    run: Run, calibrated: Path, tmp_path: Path, name: str
) -> None:
    path, back = tmp_path / "lens", tmp_path / "back.yaml"
    said = run("export", "--to", name, "-m", calibrated, "-o", path, "--max-error", "9").stdout
    assert "lens_from_camera is in the file" in said
    assert "lens_from_camera: " not in said
    assert "lens_from_camera: " in path.read_text()
    assert "that cubicfish exported" in run("import", path, "-o", back).stdout
    field = load_camera(calibrated / "camera.yaml").camera.max_angle_deg
    assert load_camera(back).camera.max_angle_deg == pytest.approx(field, abs=1e-3)
    options = run("import", path, "-o", back, "--overwrite", "--max-angle", "50").stdout
    assert "the --max-angle given" in options


@pytest.mark.slow
def test_gyroflow_holds_the_lens_of_one_camera(run: Run, calibrated: Path, tmp_path: Path) -> None:
    path = tmp_path / "lens_profile.json"
    said = run(
        "export", calibrated, "--to", "gyroflow", "-o", path, "--max-error", 3, "--json"
    ).stdout
    profile = json.loads(path.read_text())
    assert profile["use_opencv_fisheye"]
    assert profile["calib_dimension"] == {"w": 960, "h": 720}
    (fx, _, cx), (_, fy, cy), _ = profile["fisheye_params"]["camera_matrix"]
    k = profile["fisheye_params"]["distortion_coeffs"]
    pixel = kannala_brandt(np.array([[0.5, 0.2, 1.0]]), fx, fy, cx, cy, k)
    own = json.loads(said)
    assert f"{own['rms_px']:.4f}" in profile["note"]
    args = ["-o", tmp_path / "cv.yaml", "--distance", "far", "--json"]
    other = run("export", calibrated, "--to", "opencv", *args).stdout
    storage = cv2.FileStorage(str(tmp_path / "cv.yaml"), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    d = storage.getNode("distortion_coefficients").mat()
    storage.release()
    ray = np.array([[[0.5, 0.2, 1.0]]])
    theirs, _ = cv2.fisheye.projectPoints(ray, np.zeros(3), np.zeros(3), matrix, d)
    np.testing.assert_allclose(pixel, theirs[0], atol=1e-9)
    assert json.loads(other)["rms_px"] == own["rms_px"]


@pytest.fixture(scope="module")
def judged(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibration as if its boards were near to a lens whose pupil travels."""
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    record["pupil"] = {"travel": 4.0, "units": "mm"}
    record["fit"]["held_out_rms_px"] = 0.04
    record["fit"]["pupil"] = {"travel": 4.0, "distance": 300.0, "units": "mm", "rim_px": 1.2}
    folder = tmp_path_factory.mktemp("judged") / "left cam"
    folder.mkdir()
    (folder / "camera.yaml").write_text(yaml.safe_dump(record))
    return folder


def test_the_first_line_says_the_cost(run: Run, judged: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    lines = run("export", judged, "--to", "colmap", "-o", path).stdout.splitlines()
    said = re.fullmatch(
        r"loses (0\.\d{3}) px for distant things, ([\d.]+) times this camera's held-out error "
        r"\(0\.040 px\), up to \d+°; colmap-rad-tan-thin-prism-fisheye loses (0\.\d{3}) px; "
        r"(.*) lose nothing",
        lines[0],
    )
    assert said
    assert float(said[2]) == pytest.approx(float(said[1]) / 0.04, rel=0.05)
    assert float(said[3]) < float(said[1])
    exact = {name for name, one in WRITTEN.items() if one.exact} | {"maps"}
    assert set(re.split(", | and ", said[4])) == exact
    assert lines[1] == f"wrote {path}"
    assert "300 mm away, as near as the boards" in lines[-1].replace("30 cm", "300 mm")
    # What a format that loses least says names no other.
    path = tmp_path / "b.txt"
    best = run("export", judged, "--to", "colmap-rad-tan-thin-prism-fisheye", "-o", path).stdout
    assert f"loses {said[3]} px for distant things" in best
    assert "colmap" not in best.splitlines()[0]


def test_programs_that_look_at_boards_get_the_lens_for_boards(
    run: Run, judged: Path, tmp_path: Path
) -> None:
    made = {}
    for name, given in (("own", ()), ("far", ("far",)), ("boards", ("boards",)), ("30", ("30cm",))):
        option = ("--distance", *given) if given else ()
        path = tmp_path / f"{name}.yaml"
        said = run("export", judged, "--to", "opencv", "-o", path, "--json", *option).stdout
        made[name] = json.loads(said)
        own = {"file", "by_angle"}
        made[name] = {key: value for key, value in made[name].items() if key not in own}
    assert made["own"] == made["boards"] == made["30"]
    assert made["own"]["distance"] == 300
    assert made["far"]["distance"] is None
    assert made["own"]["distant"]["rms_px"] > 1.2 * made["far"]["rms_px"]
    assert 0 < made["own"]["place"][2] < 4
    assert "for things about 30 cm away" in run(
        "export", judged, "--to", "opencv", "-o", tmp_path / "b.yaml"
    ).stdout.splitlines()[0]  # fmt: skip
    args = ("export", judged, "--to", "opencv", "-o", tmp_path / "c.yaml", "--distance")
    assert "'soon' is not a length" in run(*args, "soon", code=1).stderr


def test_only_what_loses_more_than_the_camera_itself_is_refused(
    run: Run, judged: Path, tmp_path: Path
) -> None:
    record = yaml.safe_load((judged / "camera.yaml").read_text())
    path = tmp_path / "camera.yaml"

    def exported_at(held_out: float, *more: object, code: int = 0) -> str:
        record["fit"]["held_out_rms_px"] = held_out
        path.write_text(yaml.safe_dump(record))
        said = run(
            "export", path, "--to", "woodscape", "-o", tmp_path / "a.json", "--overwrite", *more,
            code=code,
        )  # fmt: skip
        return said.stdout + said.stderr

    record["P"] = (np.diag([8.0, 8.0, 1.0]) @ np.array(record["P"])).tolist()
    record["image_size"] = [7680, 5760]
    for key in ("fx", "fy", "cx", "cy"):
        record["radial"][key] *= 8
    del record["valid"], record["fit"]["uncertainty"]
    loss = float(exported_at(50.0).split()[1])
    assert loss > 0.5
    refused = exported_at(0.9 * loss, code=1)
    assert f"more than 0.5 px RMS and this camera's held-out error ({0.9 * loss:.3f} px)" in refused
    assert "lose nothing" in refused
    exported_at(1.1 * loss)
    exported_at(0.9 * loss, "--max-error", 99)
    assert "the 0.6 px of --max-error" in exported_at(50.0, "--max-error", 0.6, code=1)


def test_files_are_called_as_their_cameras(
    run: Run, judged: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for to, name in (
        ("opencv", "left_cam.opencv.yaml"), ("ros", "left_cam.ros.yaml"),
        ("colmap", "left_cam.colmap.txt"), ("c", "left_cam.h"), ("maps", "left_cam.maps.npz"),
    ):  # fmt: skip
        assert f"wrote {name}\n" in run("export", judged, "--to", to).stdout
    assert run("export", judged, "--to", "opencv", code=1).stderr.count("left_cam.opencv.yaml")
    right = tmp_path / "calibration" / "camera.yaml"
    right.parent.mkdir()
    right.write_text((judged / "camera.yaml").read_text())
    assert "wrote camera.opencv.yaml\n" in run("export", "--to", "opencv").stdout
    record = yaml.safe_load(right.read_text())
    record["made_by"] = {**record.get("made_by", {}), "title": "the right/one"}
    right.write_text(yaml.safe_dump(record))
    assert "wrote the_right_one.opencv.yaml\n" in run("export", "--to", "opencv").stdout


@pytest.mark.slow
def test_all_formats_are_compared(run: Run, judged: Path, tmp_path: Path) -> None:
    formats = json.loads(run("export", judged, "--compare", "--json").stdout)["formats"]
    assert {one["format"] for one in formats} == {*WRITTEN, "maps"}
    losses = {one["format"]: one["rms_px"] for one in formats if "rms_px" in one}
    assert losses["mrcal"] < 0.01 < losses["colmap"]
    assert losses["fisheye624"] < losses["colmap"]
    said = json.loads(
        run("export", judged, "--to", "kalibr-omni", "-o", tmp_path / "a", "--json").stdout
    )
    one = next(one for one in formats if one["format"] == "kalibr-omni")
    assert {key: said[key] for key in one} == one
    shown = run("export", judged, "--compare").stdout.splitlines()
    table = [line.split() for line in shown[3:]]
    figures = [float(row[1]) for row in table if row[1] != "-"]
    assert figures == sorted(figures)
    assert {row[0] for row in table} == {*losses}


def test_nerfstudio_takes_the_thin_prism_of_what_is_in_front(
    run: Run, judged: Path, tmp_path: Path
) -> None:
    args = ("export", judged, "--to", "nerfstudio", "--json", "-o")
    made = {}
    for name, angle in (("wide", ()), ("front", ("--max-angle", 80))):
        path = tmp_path / f"{name}.json"
        made[name] = json.loads(run(*args, path, *angle).stdout), json.loads(path.read_text())
    assert made["wide"][1]["camera_model"] == "OPENCV_FISHEYE"
    record, data = made["front"]
    assert data["camera_model"] == "FISHEYE624"
    assert record["rms_px"] < 0.6 * made["wide"][0]["rms_px"]
    # nerfstudio's own formula, its pixel centres at halves.
    camera, p = load_camera(judged / "camera.yaml").camera, data["distortion_params"]
    rays = camera.unproject(np.random.default_rng(0).uniform(200, 550, (200, 2)))
    x, y, z = (rays @ np.array(record["lens_from_camera"]).T).T
    theta = np.arctan2(np.hypot(x, y), z)
    bent = theta * (1 + sum(p[n] * theta ** (2 * n + 2) for n in range(6)))
    a, b = bent * x / np.hypot(x, y), bent * y / np.hypot(x, y)
    r2 = a * a + b * b
    u = a + p[6] * (2 * a * a + r2) + 2 * p[7] * a * b + p[8] * r2 + p[9] * r2 * r2
    v = b + p[7] * (2 * b * b + r2) + 2 * p[6] * a * b + p[10] * r2 + p[11] * r2 * r2
    pixel = np.stack([data["fl_x"] * u + data["cx"], data["fl_y"] * v + data["cy"]], -1) - 0.5
    miss = np.linalg.norm(pixel - camera.project(rays), axis=1)
    assert miss.max() <= 1.02 * record["max_px"]
    assert "nerfstudio --max-angle 89 loses" in run(
        "export", judged, "--to", "nerfstudio", "-o", tmp_path / "c"
    ).stdout.splitlines()[0]  # fmt: skip
