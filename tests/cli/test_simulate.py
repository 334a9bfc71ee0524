"""``cubicfish simulate``: photos with their truth, and the way back from them to the camera."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from lenses import smaller
from running import SAMPLE, Run
from synthetic import TRUE_LENS, checkerboard

from cubicfish_cli import save_camera, save_target
from cubicfish_cli.corner_files.observations_csv import load_corners
from cubicfish_cli.fitting.conversion.from_lens import ExactLens
from cubicfish_cli.fitting.evaluate import evaluate
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.formats.foreign import read_foreign
from cubicfish_cli.rendering.outside import lens_text, load_lens, outside_lens
from cubicfish_cli.rendering.truth import camera_points, load_poses
from cubicfish_cli.target import Target, load_target

TARGET = SAMPLE / "target.yaml"


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One board of few squares: poses and pictures of it are quickly made."""
    path = tmp_path_factory.mktemp("board") / "target.yaml"
    save_target(path, Target(units="mm", boards=(checkerboard("board", 7, 5, 40.0),)))
    return path


@pytest.fixture(scope="module")
def small_lens(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lens on a sensor of half the size: quick to render."""
    path = tmp_path_factory.mktemp("lens") / "lens.yaml"
    values = yaml.safe_load(lens_text(TRUE_LENS))
    values.update(image_size=[480, 360], fx=131, fy=131.3, cx=242.4, cy=176.2)
    path.write_text(yaml.safe_dump(values))
    return path


@pytest.mark.slow
def test_calibrating_the_photos_gives_the_camera_back(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    photos, model = tmp_path / "photos", calibrated / "camera.yaml"
    said = run("simulate", "-t", TARGET, "-m", model, "-n", 6, "-o", photos)
    assert f"Next: cubicfish calibrate {photos}" in said.stdout
    found = tmp_path / "found"
    run("calibrate", photos, "-t", TARGET, "-o", found, "--no-hold-out", "--no-cache", "-j", 1)
    said = run("compare", photos / "true_camera.yaml", found / "camera.yaml", "--json")
    apart = json.loads(said.stdout)
    assert apart["rms_px"] < 0.03
    assert apart["common_share"] > 0.9
    # The truth beside the photos: corners, poses and camera belong together.
    target, camera = load_target(TARGET), load_camera(photos / "true_camera.yaml").camera
    np.testing.assert_array_equal(camera.P, load_camera(model).camera.P)
    truth = load_corners(photos / "true_corners.csv", target)
    poses = load_poses(photos / "true_poses.csv")
    assert tuple(poses) == truth.images == tuple(f"photo_0{i}.jpg" for i in range(1, 7))
    for index, pose in enumerate(poses.values()):
        own = truth.image == index
        pixel = camera.project(camera_points(pose, truth.world[own]), near=True)
        np.testing.assert_allclose(pixel, truth.pixel[own], atol=2e-6)
    # What is found in the photos is where the truth says, with nothing invented.
    corners = load_corners(found / "corners.csv", target)
    true = dict(_by_name(truth))
    errors = [np.hypot(*(xy - true[key])) for key, xy in _by_name(corners) if key in true]
    assert len(errors) > 0.95 * len(true)
    assert np.median(errors) < 0.05
    assert evaluate(camera, corners.with_target(target)).errors.rms_px < 0.15


def _by_name(corners):
    for i in range(len(corners.pixel)):
        name = corners.images[corners.image[i]], corners.board[i], corners.column[i]
        yield (*name, corners.row[i]), corners.pixel[i]


@pytest.mark.slow
def test_a_seed_gives_the_same_photos_and_poses_can_be_taken_again(
    run: Run, small_lens: Path, board: Path, tmp_path: Path
) -> None:
    def take(name: str, *options: object) -> dict[str, bytes]:
        folder = tmp_path / name
        run("simulate", "-t", board, "-m", small_lens, "-o", folder, *options)
        return {path.name: path.read_bytes() for path in folder.iterdir()}

    first = take("a", "-n", 2, "--format", "png")
    assert set(first) == {
        "photo_01.png", "photo_02.png", "true_corners.csv", "true_poses.csv", "true_camera.yaml"
    }  # fmt: skip
    assert take("b", "-n", 2, "--format", "png") == first
    assert load_lens(tmp_path / "a" / "true_camera.yaml") == load_lens(small_lens)
    other = take("c", "-n", 2, "--seed", 1)
    assert other["true_poses.csv"] != first["true_poses.csv"]
    again = take("d", "--poses", tmp_path / "a" / "true_poses.csv", "--noise", 0, "--light", 0.3)
    assert set(again) == {name.replace("png", "jpg") for name in first}
    assert (
        again["true_poses.csv"].decode().replace("jpg", "png").encode() == (first["true_poses.csv"])
    )
    bright, dark = (
        cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        for data in (first["photo_01.png"], again["photo_01.jpg"])
    )
    assert bright.shape == dark.shape == (360, 480)
    assert dark.max() < 0.4 * bright.max()
    assert np.corrcoef(bright.ravel(), dark.ravel())[0, 1] > 0.97


@pytest.mark.slow
def test_two_photos_from_one_pose_differ_in_their_noise_only(
    run: Run, small_lens: Path, board: Path, tmp_path: Path
) -> None:
    run("simulate", "-t", board, "-m", small_lens, "-n", 1, "-o", tmp_path / "a")
    text = (tmp_path / "a" / "true_poses.csv").read_text()
    row = text.splitlines()[-1]
    (tmp_path / "two.csv").write_text(text + row.replace("photo_01", "second") + "\n")
    options = ("--poses", tmp_path / "two.csv", "--format", "png", "--noise", 3, "-o", tmp_path)
    run("simulate", "-t", board, "-m", small_lens, *options)
    one, two = (
        cv2.imread(str(tmp_path / name), 0).astype(float) for name in ("photo_01.png", "second.png")
    )
    inside = one > 20
    assert (one - two)[inside].std() == pytest.approx(3 * np.sqrt(2), rel=0.05)


@pytest.mark.slow
def test_a_lens_that_no_camera_can_hold_and_its_truth(
    run: Run, board: Path, tmp_path: Path
) -> None:
    lens = ("--lens", "moving-pupil", "--size", "480x360")
    run("simulate", "-t", board, *lens, "-n", 2, "-o", tmp_path / "a", "--format", "png")
    truth = load_lens(tmp_path / "a" / "true_camera.yaml")
    assert truth.lens == outside_lens("moving-pupil", (480, 360))
    assert truth == truth.lens.far
    target = load_target(board)
    pairs = load_corners(tmp_path / "a" / "true_corners.csv", target)
    poses = list(load_poses(tmp_path / "a" / "true_poses.csv").values())
    for index, pose in enumerate(poses):
        own = pairs.image == index
        pixel = truth.lens.project(camera_points(pose, pairs.world[own]))
        np.testing.assert_allclose(pixel, pairs.pixel[own], atol=2e-6)
        # The photo is of that lens too: a corner that is found is where it says.
        photo = cv2.imread(str(tmp_path / "a" / pairs.images[index]), 0)
        start = pixel.astype(np.float32)[:, None]
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
        found = cv2.cornerSubPix(photo, start.copy(), (3, 3), (-1, -1), stop)[:, 0]
        assert np.median(np.abs(found - pixel)) < 0.06
    # What it wrote is a lens to simulate with, and to compare with.
    poses_file = tmp_path / "a" / "true_poses.csv"
    model = ("-m", tmp_path / "a" / "true_camera.yaml")
    run("simulate", "-t", board, *model, "--poses", poses_file, "-o", tmp_path / "b",
        "--format", "png")  # fmt: skip
    for name in ("photo_01.png", "true_corners.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    said = run("compare", *(tmp_path / name / "true_camera.yaml" for name in "ab"), "--json")
    assert json.loads(said.stdout)["rms_px"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("form", ["mrcal", "colmap-rad-tan-thin-prism-fisheye"])
def test_another_tools_lens_is_taken_as_it_is(
    run: Run, calibrated: Path, board: Path, tmp_path: Path, form: str
) -> None:
    file, camera = tmp_path / "lens", tmp_path / "camera.yaml"
    save_camera(camera, smaller(load_camera(calibrated / "camera.yaml").camera, 2))
    run("export", "--to", form, "-m", camera, "-o", file)
    said = run("simulate", "-t", board, "--lens", file, "-n", 1, "-o", tmp_path / "a")
    assert "nearest to the lens of" in said.stderr
    given, _ = read_foreign(file)
    lens = ExactLens.of(given)
    target = load_target(board)
    pairs = load_corners(tmp_path / "a" / "true_corners.csv", target)
    (pose,) = load_poses(tmp_path / "a" / "true_poses.csv").values()
    points = camera_points(pose, pairs.world)
    pixel = given.project(points)
    np.testing.assert_allclose(pixel, pairs.pixel, atol=2e-6)
    rays = points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(lens.unproject(pixel), rays, atol=1e-8)
    near = load_camera(tmp_path / "a" / "true_camera.yaml").camera
    assert 1e-9 < np.abs(near.project(points) - pixel).max() < 0.1


@pytest.mark.slow
def test_overexposed_photos_bleed(run: Run, small_lens: Path, board: Path, tmp_path: Path) -> None:
    options = ("-t", board, "-m", small_lens, "-n", 1, "--noise", 0, "--format", "png")
    dark = []
    for exposure in (1, 2):
        run("simulate", *options, "--exposure", exposure, "-o", tmp_path / str(exposure))
        photo = cv2.imread(str(tmp_path / str(exposure) / "photo_01.png"), 0)
        dark.append((photo < 128).mean())
        assert (photo == 255).any() == (exposure == 2)
    assert dark[1] < dark[0]


@pytest.mark.slow
def test_json(run: Run, small_lens: Path, board: Path, tmp_path: Path) -> None:
    said = run("simulate", "-t", board, "-m", small_lens, "-n", 1, "-o", tmp_path, "--json")
    record = json.loads(said.stdout)
    assert record["photos"] == [str(tmp_path / "photo_01.jpg")]
    assert record["corners"] == len(
        load_corners(tmp_path / "true_corners.csv", load_target(board)).pixel
    )
    assert record["true_poses"] == str(tmp_path / "true_poses.csv")


@pytest.mark.slow
def test_what_goes_wrong_is_said_before_anything_is_written(
    run: Run, small_lens: Path, tmp_path: Path
) -> None:
    def refused(*options: object, code: int = 1) -> str:
        said = run("simulate", "-o", tmp_path / "out", *options, code=code).stderr
        assert not (tmp_path / "out").exists()
        return said

    given = ("-t", TARGET, "-m", small_lens)
    assert "--target" in refused("-m", small_lens, code=2)
    poses = tmp_path / "poses.csv"
    poses.write_text("image,rx,ry,rz,tx,ty,tz\na.jpg,0,0,0,0,0,-500\n")
    assert "no photo shows a corner" in refused(*given, "--poses", poses)
    assert "leave -n out" in refused(*given, "--poses", poses, "-n", 3, code=2)
    poses.write_text("image,rx,ry,rz,tx,ty,tz\n../a.jpg,0,0,0,0,0,500\n")
    assert "cannot be the name of a photo" in refused(*given, "--poses", poses)
    poses.write_text("image,rx,ry,rz,tx,ty,tz\na.jpg,0,0,0,0,0,5\na.jpg,0,0,0,0,0,5\n")
    assert "line 3: a.jpg is there twice" in refused(*given, "--poses", poses)
    bad = tmp_path / "bad.yaml"
    for change, words in (
        ("fx: -3", "fx and fy must be above 0"),
        ("k: [1, 2]", "k must be 4 numbers"),
        ("k: [-0.5, 0, 0, 0]", "stops growing"),
        ("kk: 3", "unknown key 'kk'"),
    ):
        key, _, value = change.partition(":")
        values = yaml.safe_load(small_lens.read_text()) | {key: yaml.safe_load(value)}
        bad.write_text(yaml.safe_dump(values))
        assert words in refused("-t", TARGET, "-m", bad)
    true = {"lens": "mirror", "image_size": [640, 480], "units": "mm", "centre": 0, "distance": 9}
    for changes, words in (
        ({"lens": "telescope"}, "lens must be one of moving-pupil, mirror"),
        ({"distance": -1}, "distance must be above 0"),
        ({"centre": [1, 2]}, "centre must be a number"),
        ({"units": 3}, "units must be a word"),
        ({"image_size": [640, 0]}, "image_size must be two whole numbers"),
        ({"centres": 3}, "unknown key 'centres'"),
    ):
        bad.write_text(yaml.safe_dump(true | changes))
        assert words in refused("-t", TARGET, "-m", bad)
    bad.write_text(yaml.safe_dump({"lens": "mirror"}))
    assert "image_size is missing" in refused("-t", TARGET, "-m", bad)
    other = {"fx": 300, "fy": 300, "cx": 320, "cy": 240, "width": 640, "height": 480, "fps": 30}
    bad.write_text(yaml.safe_dump(other | {"camera": "front", "skew": 0}))
    assert "it has no key 'cubicfish'" in refused("-t", TARGET, "-m", bad)
    assert "leave one of them out" in refused(*given, "--lens", "mirror", code=2)
    assert "no file and none of" in refused("-t", TARGET, "--lens", "mirrors", code=2)
    assert "--size goes with --lens" in refused(*given, "--size", "640x480", code=2)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "true_poses.csv").write_text("mine")
    said = run("simulate", *given, "-n", 1, "-o", tmp_path / "taken", code=1).stderr
    assert "exists already" in said
    assert [path.name for path in (tmp_path / "taken").iterdir()] == ["true_poses.csv"]


@pytest.mark.slow
def test_a_film_comes_with_the_truth_of_its_frames(
    run: Run, small_lens: Path, board: Path, tmp_path: Path
) -> None:
    pytest.importorskip("av")
    from cubicfish_cli.films.decoding import decode
    from cubicfish_cli.films.source import opened

    options = ("--film", 2.1, "--rate", 10, "--shutter", 4, "--readout", 8, "-o", tmp_path / "f")
    said = run("simulate", "-t", board, "-m", small_lens, *options, "--json")
    record = json.loads(said.stdout)
    assert record["photos"] == [str(tmp_path / "f" / "film.mp4")]
    with opened(tmp_path / "f" / "film.mp4") as (container, stream):
        frames = list(decode(tmp_path / "film.mp4", container, stream))
        times = [float(frame.pts * stream.time_base) for frame in frames]
    assert times == pytest.approx(np.arange(21) / 10)
    poses = load_poses(tmp_path / "f" / "true_poses.csv")
    assert list(poses)[:3] == [f"film_000000.{n}00s.png" for n in range(3)]
    assert len(poses) == 21
    # What is decoded shows the corners where the table has them.
    truth = load_corners(tmp_path / "f" / "true_corners.csv", load_target(board))
    assert len(truth.pixel) == record["corners"]
    name = truth.images[0]
    own = truth.pixel[truth.image == 0]
    picture = frames[list(poses).index(name)].to_ndarray(format="gray")
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
    start = np.ascontiguousarray(own, np.float32)[:, None].copy()
    found = cv2.cornerSubPix(picture, start, (3, 3), (-1, -1), stop)[:, 0]
    assert np.median(np.hypot(*(found - own).T)) < 0.2


def test_options_of_films_and_of_photos_do_not_mix(
    run: Run, small_lens: Path, tmp_path: Path
) -> None:
    given = ("simulate", "-t", TARGET, "-m", small_lens, "-o", tmp_path / "f")
    for options, words in (
        (("--shutter", 8), "--shutter is of films"),
        (("--rate", 30), "--rate is of films"),
        (("--film", 2, "-n", 3), "-n is of photos"),
        (("--film", 2, "--format", "png"), "--format is of photos"),
    ):
        assert words in run(*given, *options, code=2).stderr
    pytest.importorskip("av")
    odd = ("simulate", "-t", TARGET, "--lens", "equisolid", "--size", "481x360", "--film", 2)
    assert "even width and height" in run(*odd, "-o", tmp_path / "f", code=1).stderr
    assert not (tmp_path / "f").exists()


def test_a_lens_is_read_as_it_was_written(tmp_path: Path) -> None:
    (tmp_path / "lens.yaml").write_text(lens_text(TRUE_LENS))
    assert load_lens(tmp_path / "lens.yaml") == TRUE_LENS
