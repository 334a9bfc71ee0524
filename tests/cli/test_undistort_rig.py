"""undistort --rig: which photos make a shot, what becomes of it, and nothing replaced unasked."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from running import Run
from scipy.spatial.transform import Rotation

from cubicfish_cli import load_rig
from cubicfish_cli.cli.options import keys_of
from cubicfish_cli.geometry import camera_centre
from tests.cli.test_export_rig import made_rig

SMALL = ("--size", "120x60")
WORLD = np.array([[0.0, 100.0, 900.0], [150.0, -80.0, 1000.0]])


@pytest.fixture(scope="module")
def rig(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cameras side by side, and two shots of the world's directions in colours."""
    path = made_rig(calibrated, tmp_path_factory.mktemp("rig"), 2)
    record = yaml.safe_load(path.read_text())
    record["fit"] = {
        "per_shot": [
            {"shot": "0001", "rig_from_world": {
                "rotation_vector": [0.1, -0.2, 0.3], "translation": [5.0, -6.0, 700.0]}}
        ]
    }  # fmt: skip
    path.write_text(yaml.safe_dump(record))
    return path


@pytest.fixture(scope="module")
def shots(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shots")
    for one in load_rig(rig).cameras:
        camera = one.file.camera
        width, height = camera.image_size
        pixel = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
        rays = camera.unproject(pixel) @ one.rotation
        photo = np.nan_to_num(128 + 100 * rays).clip(0, 255).astype(np.uint8)
        (folder / one.name).mkdir()
        for number in (1, 2):
            cv2.imwrite(str(folder / one.name / f"{number:04d}.png"), photo)
    return folder


@pytest.mark.slow
def test_a_shot_becomes_a_panorama(run: Run, rig: Path, shots: Path, tmp_path: Path) -> None:
    out = tmp_path / "all.png"
    photos = [shots / name / "0001.png" for name in ("right", "left")]
    args = ["--rig", rig, "--mask", tmp_path / "mask.png", "--camera", out, "--json"]
    record = json.loads(run("undistort", *photos, out, *args).stdout)
    assert set(record) <= set(keys_of("undistort"))
    assert record["view"]["kind"] == "equirectangular"
    assert record["files"] == [str(out)]
    picture = cv2.imread(str(out)).astype(float)
    height, width = picture.shape[:2]
    assert [width, height] == record["view"]["size"]
    mask = cv2.imread(str(tmp_path / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    x = (np.arange(width) - (width - 1) / 2) / record["view"]["focal"]
    y = (np.arange(height) - (height - 1) / 2) / record["view"]["focal"]
    x, y = np.meshgrid(x, y)
    rays = np.stack([np.sin(x) * np.cos(y), np.sin(y), np.cos(x) * np.cos(y)], -1)
    assert 0.4 < mask.mean() < 0.95
    inner = cv2.erode(mask.astype(np.uint8), np.ones((9, 9))) > 0
    assert np.abs(picture - (128 + 100 * rays))[inner].max() < 3
    assert (tmp_path / "all.view.yaml").is_file()


@pytest.mark.parametrize("how", ["folder", "folders", "by order", "names", "one"])
def test_photos_find_their_cameras(
    run: Run, rig: Path, shots: Path, tmp_path: Path, how: str
) -> None:
    out = tmp_path / "out"
    given: list[Path] = {
        "folder": [shots],
        "folders": [shots / "right", shots / "left"],
        "by order": [tmp_path / "a.png", tmp_path / "b.png"],
        "names": [tmp_path / "right_7.png", tmp_path / "left_7.png"],
        "one": [shots / "right"],
    }[how]
    for path in given:
        if path.suffix:
            camera = "left" if path.name.startswith(("a", "l")) else "right"
            shutil.copy(shots / camera / "0001.png", path)
    if how in ("by order", "names"):
        run("undistort", *given, out, "--rig", rig, *SMALL)
        assert len(list(out.iterdir())) == 1
    else:
        run("undistort", *given, out, "--rig", rig, *SMALL)
        assert sorted(file.name for file in out.iterdir()) == ["0001.png", "0002.png"]
    picture = cv2.imread(str(next(out.iterdir()))).astype(float)
    # Straight ahead: z is 1, x and y are 0; of one camera alone the same.
    np.testing.assert_allclose(picture[30, 60], [128, 128, 228], atol=5)


def test_the_ground_is_shown_from_above(run: Run, rig: Path, shots: Path, tmp_path: Path) -> None:
    out = tmp_path / "above.png"
    photos = [shots / name / "0001.png" for name in ("left", "right")]
    args = ["--rig", rig, "--ground", "500", "--margin", "300", "--pixels-per-unit", "0.2"]
    said = run("undistort", *photos, out, *args)
    assert "pixels per mm" in said.stdout
    places = [camera_centre(one.rotation, one.translation) for one in load_rig(rig).cameras]
    across = abs(places[1][0] - places[0][0])
    picture = cv2.imread(str(out))
    assert picture.shape[1] == round(0.2 * (across + 600))
    # Below the first camera the ray is straight down: y is 1.
    column = round(0.2 * (places[0][0] - min(place[0] for place in places) + 300))
    row = round(0.2 * (max(place[2] for place in places) + 300))
    assert picture[row, column, 1] > 215


@pytest.mark.slow
def test_a_board_of_the_calibration_is_the_ground(
    run: Run, rig: Path, shots: Path, tmp_path: Path
) -> None:
    target = tmp_path / "target.yaml"
    target.write_text(
        "units: mm\nboards:\n- {name: floor, type: checkerboard, corners: [5, 4], square: 50}\n"
    )
    photos = [shots / name / "0001.png" for name in ("left", "right")]
    args = ["--rig", rig, "--plane", "floor", "--target", target, "--json"]
    record = json.loads(run("undistort", *photos, tmp_path / "a.png", *args).stdout)
    view = record["view"]
    down = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()[:, 2]  # x cross y of the board
    axes = np.array([view["x_axis"], view["y_axis"]])
    np.testing.assert_allclose(np.cross(*axes), down, atol=1e-9)
    corner = np.array([5.0, -6.0, 700.0])  # the board's first corner, in the rig's frame
    assert (corner - view["origin"]) @ down == pytest.approx(0, abs=1e-6)
    later = [shots / name / "0002.png" for name in ("left", "right")]
    said = run("undistort", *later, tmp_path / "b.png", *args[:-1], code=1).stderr
    assert "where shot '0002' was taken" in said
    run("undistort", *later, tmp_path / "b.png", *args[:-1], "--shot", "0001")
    same = [cv2.imread(str(tmp_path / name)) for name in ("a.png", "b.png")]
    assert (same[0] == same[1]).all()


@pytest.mark.slow
def test_faces_of_cubes_have_masks_and_places(
    run: Run, rig: Path, shots: Path, tmp_path: Path
) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    out = tmp_path / "cube"
    args = ["--rig", rig, "--view", "cube", "--size", "80x80", "--json"]
    record = json.loads(run("undistort", shots, out, *args).stdout)
    assert record["images"] == 2
    assert {Path(file).name for file in record["extra_files"]} == {
        "rig_config.json", "transforms.json"
    }  # fmt: skip
    assert not (out / "images" / "left_back").exists()  # it sees nothing of it
    read = load_rig(rig)
    (config,) = pycolmap.read_rig_config(out / "rig_config.json")
    first = config.cameras[0]
    assert first.image_prefix == "left_front/"
    frames = {frame["file_path"]: frame for frame in json.loads(
        (out / "transforms.json").read_text())["frames"]}  # fmt: skip
    assert {Path(path).name for path in frames} == {"0001.png"}  # where it was taken is known
    own = {one.image_prefix[:-1]: one for one in config.cameras}
    pose = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), np.array([5.0, -6.0, 700.0])
    for name in ("left_front", "right_front", "right_left"):
        photo = cv2.imread(str(out / "images" / name / "0001.png")).astype(float)
        mask = cv2.imread(str(out / "masks" / name / "0001.png.png"), cv2.IMREAD_GRAYSCALE)
        assert photo.shape[:2] == mask.shape == (80, 80)
        frame = frames[f"images/{name}/0001.png"]
        assert (out / frame["mask_path"]).is_file()
        # The face's colours are those of directions in the rig's frame.
        turn = np.eye(3) if name == "left_front" else own[name].cam_from_rig.rotation.matrix()
        x, y = np.meshgrid(np.arange(80) + 0.5, np.arange(80) + 0.5)  # COLMAP's middles
        fx, fy, cx, cy = own[name].camera.params
        rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], -1)
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ turn
        sound = cv2.erode((mask > 0).astype(np.uint8), None) > 0
        assert sound.sum() > 500
        assert np.abs(photo - (128 + 100 * rays))[sound].max() < 3
        # nerfstudio's place of it is that of the shot.
        world_from_face = np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1])
        camera = read.camera(name.split("_")[0])
        centre = camera_centre(camera.rotation, camera.translation)
        np.testing.assert_allclose(world_from_face[:3, 3], (centre - pose[1]) @ pose[0], atol=1e-9)
        np.testing.assert_allclose(world_from_face[:3, :3].T @ pose[0].T, turn, atol=1e-6)
        assert frame["fl_x"] == pytest.approx(40)
        assert frame["cx"] == pytest.approx(40)


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["--crop", "10x10+0+0"], 2, "--crop is for the photos of one camera"),
        (["--shot", "1"], 2, "--shot goes with --plane"),
        (["--margin", "1"], 2, "--margin goes with --plane"),
        (["--ground", "0"], 2, "HEIGHT,PITCH,ROLL: a height above 0"),
        (["--ground", "5,91"], 2, "PITCH from -90 to 90"),
        (["--ground", "5,x"], 2, "HEIGHT,PITCH,ROLL, such as"),
        (["--ground", "5", "--distance", "5"], 2, "leave out --distance"),
        (["--ground", "5", "--plane", "floor"], 2, "the same thing twice"),
        (["--ground", "5", "--hfov", "50"], 2, "leave out the view's"),
        (["--view", "cube", "--mask", "m.png"], 2, "leave out --mask"),
    ],
)
def test_what_does_not_go_together_is_said(
    run: Run, rig: Path, shots: Path, tmp_path: Path, args: list[str], code: int, words: str
) -> None:
    photos = [shots / name / "0001.png" for name in ("left", "right")]
    said = run("undistort", *photos, tmp_path / "x.png", "--rig", rig, *args, code=code).stderr
    assert words in said
    assert list(tmp_path.iterdir()) == []


def test_photos_may_be_an_exact_rescale(run: Run, rig: Path, shots: Path, tmp_path: Path) -> None:
    photos = [shots / name / "0001.png" for name in ("left", "right")]
    half = [tmp_path / f"{path.parent.name}.png" for path in photos]
    for path, small in zip(photos, half, strict=True):
        picture = cv2.imread(str(path))
        cv2.imwrite(str(small), cv2.resize(picture, (480, 360), interpolation=cv2.INTER_AREA))
    args = ["--rig", rig, *SMALL]
    run("undistort", *photos, tmp_path / "a.png", *args)
    run("undistort", *half, tmp_path / "b.png", *args)
    a, b = (cv2.imread(str(tmp_path / f"{name}.png")).astype(int) for name in "ab")
    assert np.median(np.abs(a - b)) <= 1
    cv2.imwrite(str(half[1]), np.zeros((100, 480, 3), np.uint8))
    said = run("undistort", *half, tmp_path / "c.png", *args, code=1).stderr
    assert "Error: camera right: " in said


def test_options_of_rigs_need_one(run: Run, shots: Path, tmp_path: Path) -> None:
    photo = shots / "left" / "0001.png"
    said = run("undistort", photo, tmp_path / "x.png", "--ground", "5", code=2).stderr
    assert "--ground goes with --rig" in said


def test_whose_a_photo_is_must_be_known(run: Run, rig: Path, shots: Path, tmp_path: Path) -> None:
    shutil.copy(shots / "left" / "0001.png", tmp_path / "a.png")
    args = [tmp_path / "a.png", tmp_path / "x.png", "--rig", rig]
    said = run("undistort", *args, code=2).stderr
    assert "a.png" in said
    assert "left, right" in said


def test_shots_that_fail_are_named_and_the_others_done(
    run: Run, rig: Path, shots: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(shots, tmp_path / "shots")
    cv2.imwrite(str(folder / "right" / "0002.png"), np.zeros((50, 60, 3), np.uint8))
    out = tmp_path / "out"
    said = run("undistort", folder, out, "--rig", rig, *SMALL, code=1).stderr
    assert "failed: shot 0002: camera right: the photo has 60x50 pixels" in said
    ending = "1 of 2 shots could not be undistorted: the reason is above, the other is done"
    assert said.endswith(f"Error: {ending}\n")
    assert [file.name for file in out.iterdir()] == ["0001.png"]
    said = run("undistort", folder, out, "--rig", rig, *SMALL, code=1).stderr
    assert "0001.png exists" in said
    said = run("undistort", folder, tmp_path / "x.png", "--rig", rig, code=2).stderr
    assert "2 shots become a folder" in said
