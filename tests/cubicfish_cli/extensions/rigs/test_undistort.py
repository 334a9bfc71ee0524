"""Which photos make a rig's shot, what becomes of it, and nothing is replaced unasked."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from reference import keys_of
from running import Run

from cubicfish_cli import load_rig
from tests.cubicfish_cli.extensions.rigs.test_export import made_rig

SMALL = ("--size", "120x60")
HALF, QUARTER = (480, 360), (240, 180)


@pytest.fixture(scope="module")
def rig(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cameras side by side."""
    return made_rig(calibrated, tmp_path_factory.mktemp("rig"), 2)


@pytest.fixture(scope="module")
def shots(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two shots of the world's directions in colours."""
    folder = tmp_path_factory.mktemp("shots")
    for one in load_rig(rig).cameras:
        camera = one.camera.for_photos(HALF)
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
    args = ["-m", rig, "--mask", tmp_path / "mask.png", "--camera", out, "--json"]
    record = json.loads(run("rig", "undistort", *photos, out, *args).stdout)
    assert set(record) <= set(keys_of("rig undistort"))
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
        run("rig", "undistort", *given, out, "-m", rig, *SMALL)
        assert len(list(out.glob("[!.]*"))) == 1
    else:
        run("rig", "undistort", *given, out, "-m", rig, *SMALL)
        assert sorted(file.name for file in out.glob("[!.]*")) == ["0001.png", "0002.png"]
    picture = cv2.imread(str(next(out.glob("[!.]*")))).astype(float)
    # Straight ahead: z is 1, x and y are 0; of one camera alone the same.
    np.testing.assert_allclose(picture[30, 60], [128, 128, 228], atol=5)


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["--view", "plane:floor"], 2, "'plane:floor' is not one of them"),
        (["--view", "cube"], 2, "--view cube is for photos of one camera"),
        (["--crf", "20"], 2, "No such option"),
        (["--quality", "50"], 2, "--quality goes with JPEG and WebP files, not with .png"),
    ],
)
def test_what_does_not_go_together_is_said(
    run: Run, rig: Path, shots: Path, tmp_path: Path, args: list[object], code: int, words: str
) -> None:
    photos = [shots / name / "0001.png" for name in ("left", "right")]
    said = run("rig", "undistort", *photos, tmp_path / "x.png", "-m", rig, *args, code=code).stderr
    assert words in said
    assert list(tmp_path.iterdir()) == []


def test_photos_may_be_an_exact_rescale(run: Run, rig: Path, shots: Path, tmp_path: Path) -> None:
    photos = [shots / name / "0001.png" for name in ("left", "right")]
    half = [tmp_path / f"{path.parent.name}.png" for path in photos]
    for path, small in zip(photos, half, strict=True):
        picture = cv2.imread(str(path))
        cv2.imwrite(str(small), cv2.resize(picture, QUARTER, interpolation=cv2.INTER_AREA))
    args = ["-m", rig, *SMALL]
    run("rig", "undistort", *photos, tmp_path / "a.png", *args)
    run("rig", "undistort", *half, tmp_path / "b.png", *args)
    a, b = (cv2.imread(str(tmp_path / f"{name}.png")).astype(int) for name in "ab")
    assert np.median(np.abs(a - b)) <= 1
    cv2.imwrite(str(half[1]), np.zeros((100, 480, 3), np.uint8))
    said = run("rig", "undistort", *half, tmp_path / "c.png", *args, code=1).stderr
    assert "Error: camera right: " in said


def test_whose_a_photo_is_must_be_known(run: Run, rig: Path, shots: Path, tmp_path: Path) -> None:
    shutil.copy(shots / "left" / "0001.png", tmp_path / "a.png")
    args = [tmp_path / "a.png", tmp_path / "x.png", "-m", rig]
    said = run("rig", "undistort", *args, code=2).stderr
    assert "a.png" in said
    assert "left, right" in said


def test_shots_that_fail_are_named_and_the_others_done(
    run: Run, rig: Path, shots: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(shots, tmp_path / "shots")
    cv2.imwrite(str(folder / "right" / "0002.png"), np.zeros((50, 60, 3), np.uint8))
    out = tmp_path / "out"
    said = run("rig", "undistort", folder, out, "-m", rig, *SMALL, code=1).stderr
    assert "failed: shot 0002: camera right: the photo has 60x50 pixels" in said
    ending = "1 of 2 shots could not be undistorted: see above"
    assert said.endswith(f"Error: {ending}\n")
    assert [file.name for file in out.glob("[!.]*")] == ["0001.png"]
    said = run("rig", "undistort", folder, out, "-m", rig, *SMALL, code=1).stderr
    assert "0001.png exists" in said
    said = run("rig", "undistort", folder, tmp_path / "x.png", "-m", rig, code=2).stderr
    assert "2 shots become a folder" in said


def test_shots_that_exist_are_skipped_and_the_others_done_by_threads(
    run: Run, rig: Path, shots: Path, tmp_path: Path
) -> None:
    args = [
        "rig",
        "undistort",
        shots,
        tmp_path / "out",
        "-m",
        rig,
        *SMALL,
        "-j",
        2,
        "--skip-existing",
    ]
    run(*args)
    one, two = tmp_path / "out" / "0001.png", tmp_path / "out" / "0002.png"
    made = two.read_bytes()
    one.write_bytes(b"mine")
    two.unlink()
    done = run(*args)
    assert "skipped 1 shot whose result exists" in done.stderr
    assert (one.read_bytes(), two.read_bytes()) == (b"mine", made)


@pytest.mark.parametrize(
    ("command", "default"), [("undistort", "equirectangular, all around"), ("map", "perspective")]
)
def test_help_says_what_a_rig_has_and_nothing_of_one_camera(
    run: Run, command: str, default: str
) -> None:
    said = " ".join(run("rig", command, "--help").stdout.split())
    assert f"[default: {default}" in said
    for only_of_one in ("plane:BOARD", "cube", "|whole|", "[default: the photo's]"):
        assert only_of_one not in said
    assert ("stereographic" in said) == (command == "undistort")


@pytest.mark.parametrize(
    "options", [("--view", "cube"), ("--view", "plane:one"), ("--fit", "whole")]
)
@pytest.mark.parametrize("command", ["undistort", "map"])
def test_what_is_of_one_camera_is_refused(
    run: Run, rig: Path, shots: Path, tmp_path: Path, command: str, options: tuple[str, str]
) -> None:
    sources = [shots] if command == "undistort" else []
    line = ("rig", command, *sources, tmp_path / "out.npz", "-m", rig, *options)
    said = run(*line, code=2).stderr
    assert options[1] in said or options[0] in said
    assert list(tmp_path.iterdir()) == []
