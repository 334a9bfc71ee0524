"""undistort and map: the right view of the right photos, and nothing replaced unasked."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from conftest import SAMPLE, Run

from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.undistortion.maps import load_map

PHOTO = SAMPLE / "photos" / "corner_01.jpg"


@pytest.fixture
def model(calibrated: Path) -> Path:
    return calibrated / "camera.yaml"


def picture(path: Path) -> np.ndarray:
    read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert read is not None
    return read


def test_a_photo_is_what_cv2_makes_of_the_written_map(
    run: Run, calibrated: Path, model: Path, tmp_path: Path
) -> None:
    said = run("undistort", PHOTO, tmp_path / "flat.png", "-m", model).stdout
    assert said.startswith(f"wrote {tmp_path / 'flat.png'}: 960x720 pixels, ")
    with np.load(calibrated / "undistort_map.npz") as data:
        expected = cv2.remap(picture(PHOTO), data["map_x"], data["map_y"], cv2.INTER_LINEAR)
    np.testing.assert_array_equal(picture(tmp_path / "flat.png"), expected)


def test_a_folder_goes_to_a_folder(run: Run, model: Path, tmp_path: Path) -> None:
    photos = tmp_path / "in"
    photos.mkdir()
    for name in ("a.jpg", "b.jpg"):
        (photos / name).write_bytes(PHOTO.read_bytes())
    (photos / "notes.txt").write_text("not a photo")
    said = run("undistort", photos, tmp_path / "out", "-m", model, "--size", "96x72").stdout
    assert said.startswith(f"wrote 2 pictures to {tmp_path / 'out'}: 96x72 pixels, ")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.jpg", "b.jpg"]
    assert picture(tmp_path / "out" / "b.jpg").shape == (72, 96)


def test_nothing_is_replaced_unasked_and_nothing_done_by_half(
    run: Run, model: Path, tmp_path: Path
) -> None:
    photos, out = tmp_path / "in", tmp_path / "out"
    for folder in (photos, out):
        folder.mkdir()
    for name in ("a.jpg", "b.jpg"):
        (photos / name).write_bytes(PHOTO.read_bytes())
    (out / "b.jpg").write_text("old")
    args = ["undistort", photos, out, "-m", model, "--size", "96x72"]
    assert "b.jpg exists already" in run(*args, code=1).stderr
    assert [path.name for path in out.iterdir()] == ["b.jpg"]
    run(*args, "--overwrite")
    assert picture(out / "b.jpg").shape == (72, 96)


def test_the_view_is_the_one_asked_for(run: Run, model: Path, tmp_path: Path) -> None:
    args = ["--fov", 90, "--size", "101x51", "--yaw", 30, "--pitch", 20, "--roll", 90]
    said = run("map", tmp_path / "m.npz", "-m", model, *args).stdout
    assert said == (
        f"wrote {tmp_path / 'm.npz'}: 101x51 pixels, 90.0° across, focal length 50.50 px\n"
    )
    written = load_map(tmp_path / "m.npz")
    assert written.map_x.shape == (51, 101)
    # The middle looks 30° to the right and 20° up.
    yaw, pitch = np.radians([30, 20])
    ray = [np.sin(yaw) * np.cos(pitch), -np.sin(pitch), np.cos(yaw) * np.cos(pitch)]
    middle = [written.map_x[25, 50], written.map_y[25, 50]]
    np.testing.assert_allclose(middle, load_camera(model).camera.project(ray), atol=1e-3)
    # Rolled clockwise by a right angle, what is up in the scene is on the left.
    assert written.map_y[25, 30] < written.map_y[25, 50] < written.map_y[25, 70]


def test_another_size_keeps_the_default_field(run: Run, model: Path, tmp_path: Path) -> None:
    run("map", tmp_path / "a.npz", "-m", model)
    run("map", tmp_path / "b.npz", "-m", model, "--size", "480x360")
    a, b = (json.loads(load_map(tmp_path / f"{n}.npz").view.to_json()) for n in "ab")
    assert a["size"] == [960, 720]
    assert b["focal"] == pytest.approx(a["focal"] / 2)


@pytest.mark.parametrize(
    ("args", "code", "message"),
    [
        (["undistort", PHOTO, "out.xyz"], 1, "out.xyz"),
        (["undistort", "no.png", "out.png"], 1, "no.png"),
        (["undistort", PHOTO, "."], 2, "OUT is a folder: name a file, such as flat.png"),
        (["undistort", PHOTO, "out.png", "--fov", "180"], 2, "--fov"),
        (["undistort", PHOTO, "out.png", "--size", "99999x10"], 1, "size"),
        (["undistort", PHOTO], 2, "Missing argument"),
        (["map", "out.exr"], 2, "out.exr: maps are written as .npz"),
    ],
)
def test_what_cannot_be_done_is_said_and_leaves_nothing(
    run: Run,
    model: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    args: list[object],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*args, "-m", model, code=code)
    assert message in result.stderr
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_a_photo_of_another_size_is_refused(run: Run, model: Path, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((72, 96), np.uint8))
    said = run("undistort", tmp_path / "small.png", tmp_path / "o.png", "-m", model, code=1).stderr
    assert "the photo has 96x72 pixels, the camera was calibrated for 960x720" in said
    assert not (tmp_path / "o.png").exists()
