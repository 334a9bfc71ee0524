"""``cubicfish simulate``: photos with their truth, and the way back from them to the camera."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from lenses import smaller
from running import Run
from samples import SAMPLE
from synthetic import checkerboard

from cubicfish import Target, load_camera, load_corners
from cubicfish.fit.evaluate import evaluate
from cubicfish.scene.truth import camera_points
from cubicfish_cli import save_camera, save_target
from cubicfish_cli.extensions.simulation.poses import load_poses

TARGET = SAMPLE / "target.yaml"


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One board of few squares: poses and pictures of it are quickly made."""
    path = tmp_path_factory.mktemp("board") / "target.yaml"
    save_target(path, Target(units="mm", boards=(checkerboard("board", 7, 5, 40.0),)))
    return path


@pytest.fixture(scope="module")
def small_lens(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A camera with a sensor of half the size: quick to render."""
    path = tmp_path_factory.mktemp("lens") / "camera.yaml"
    save_camera(path, smaller(load_camera(calibrated / "camera.yaml").camera, 2))
    return path


@pytest.mark.slow
def test_calibrating_the_photos_gives_the_camera_back(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    photos, model = tmp_path / "photos; $(no)", calibrated / "camera.yaml"
    said = run("simulate", "-t", TARGET, "-m", model, "-n", 6, "-o", photos)
    assert f"Next: cubicfish calibrate '{photos}'" in said.stdout
    found = tmp_path / "found"
    run("calibrate", photos, "-t", TARGET, "-o", found, "--no-hold-out", "--no-cache", "-j", 1)
    said = run("compare", photos / "true_camera.yaml", found / "camera.yaml", "--json")
    apart = json.loads(said.stdout)
    assert apart["rms_px"] < 0.05  # what six photos leave open, and no prior is chosen by others
    assert apart["common_share"] > 0.9
    # The truth beside the photos: corners, poses and camera belong together.
    target, camera = Target.load(TARGET), load_camera(photos / "true_camera.yaml").camera
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
    true = load_camera(tmp_path / "a" / "true_camera.yaml").camera
    np.testing.assert_array_equal(true.P, load_camera(small_lens).camera.P)
    other = take("c", "-n", 2, "--seed", 1)
    assert other["true_poses.csv"] != first["true_poses.csv"]
    again = take("d", "--poses", tmp_path / "a" / "true_poses.csv", "--noise", 0, "--exposure", 0.3)
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
        load_corners(tmp_path / "true_corners.csv", Target.load(board)).pixel
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
    assert "leave --number out" in refused(*given, "--poses", poses, "-n", 3, code=2)
    poses.write_text("image,rx,ry,rz,tx,ty,tz\n../a.jpg,0,0,0,0,0,500\n")
    assert "cannot be the name of a photo" in refused(*given, "--poses", poses)
    poses.write_text("image,rx,ry,rz,tx,ty,tz\na.jpg,0,0,0,0,0,5\na.jpg,0,0,0,0,0,5\n")
    assert "line 3: a.jpg is there twice" in refused(*given, "--poses", poses)
    (tmp_path / "other.yaml").write_text("fx: 300\nfy: 300\ncx: 320\ncy: 240\n")
    assert "it has no key 'cubicfish'" in refused("-t", TARGET, "-m", tmp_path / "other.yaml")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "true_poses.csv").write_text("mine")
    said = run("simulate", *given, "-n", 1, "-o", tmp_path / "taken", code=1).stderr
    assert "exists already" in said
    assert [path.name for path in (tmp_path / "taken").iterdir()] == ["true_poses.csv"]
