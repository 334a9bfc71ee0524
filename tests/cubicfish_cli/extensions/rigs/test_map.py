"""map --pair: two maps with common rows, and what it takes to measure with them."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from reference import keys_of
from running import Run
from saved_maps import read_map

from cubicfish_cli import load_rig
from tests.cubicfish_cli.extensions.rigs.test_export import made_rig


@pytest.fixture(scope="module")
def pair(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_rig(calibrated, tmp_path_factory.mktemp("pair"), 2)


@pytest.mark.parametrize("kind", ["perspective", "cylindrical", "equirectangular"])
def test_maps_show_one_point_in_one_row(run: Run, pair: Path, tmp_path: Path, kind: str) -> None:
    out = tmp_path / "out.npz"
    args = ["--pair", "left,right", "-m", pair, "--view", kind, "--scale", "150", "--json"]
    record = json.loads(run("rig", "map", out, *args).stdout)
    assert set(record) <= set(keys_of("rig map"))
    assert [Path(file).name for file in record["files"]] == ["out_left.npz", "out_right.npz"]
    about = yaml.safe_load((tmp_path / "out.stereo.yaml").read_text())
    assert about == record["stereo"]
    assert about["baseline"] == pytest.approx(np.linalg.norm([-120, 3, 20]))
    assert about["units"] == "mm"
    assert ("Q" in about) == (kind == "perspective")
    # Points of the rig's frame, looked up in the maps themselves.
    rig = load_rig(pair)
    points = np.array([[100.0, 50, 900], [-300, 200, 700], [40, -500, 800], [600, 10, 1000]])
    rows = []
    for name in ("left", "right"):
        made = read_map(tmp_path / f"out_{name}.npz")
        camera = rig.camera(name)
        pixel = camera.camera.project(points @ camera.rotation.T + camera.translation)
        found = made.central_view.pixels(camera.camera.unproject(pixel))
        x, y = np.rint(found).astype(int).T
        here = np.column_stack([made.map_x[y, x], made.map_y[y, x]])
        assert np.abs(here - pixel).max() < 2  # whole pixels of the picture
        rows.append(found[:, 1])
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-6)


def test_two_cameras_need_not_be_named_and_photos_may_be_smaller(
    run: Run, pair: Path, tmp_path: Path
) -> None:
    args = ["rig", "map", tmp_path / "a.png", "-m", pair.parent, "--size", "64x48"]
    run(*args, "--photo-size", "480x360")
    names = {file.name for file in tmp_path.iterdir()}
    assert {"a_left_x.png", "a_right_y.png", "a_left.view.yaml"} <= names
    about = yaml.safe_load((tmp_path / "a.stereo.yaml").read_text())
    assert about["photo_sizes"] == [[480, 360], [480, 360]]


def test_a_sphere_of_no_given_size_shows_what_both_see(
    run: Run, pair: Path, tmp_path: Path
) -> None:
    args = ["-m", pair, "--view", "equirectangular", "--json"]
    view = json.loads(run("rig", "map", tmp_path / "a.npz", *args).stdout)["view"]
    assert 140 < view["vfov_deg"] < 200
    assert view["hfov_deg"] > 150


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["--pair", "left,right", "--rotate", "10"], 2, "0,PITCH,0"),
        (["--pair", "left,right", "--view", "stereographic"], 2, "or equirectangular"),
        (["--pair", "left,right", "--view", "cube"], 2, "do not agree"),
        (["--pair", "left,right", "--redistort"], 2, "No such option"),
        (["--pair", "left,write"], 1, "did you mean 'right'"),
        (["--pair", "left"], 2, "left,right"),
        ([], 1, "--pair: left, right, rear cam"),
        (["--pair", "left,rear cam"], 1, "nothing in common"),
    ],
)
def test_what_cannot_be_is_said_and_nothing_written(
    run: Run, calibrated: Path, tmp_path: Path, args: list[str], code: int, words: str
) -> None:
    rig = made_rig(calibrated, tmp_path / "rig", 3)
    narrow = tmp_path / "rig" / "rear cam" / "camera.yaml"
    text = re.sub(r"max_angle_deg: [0-9.]+", "max_angle_deg: 60.0", narrow.read_text(), count=1)
    narrow.write_text(text)
    out = tmp_path / "out" / "a.npz"
    assert words in run("rig", "map", out, "-m", rig, *args, code=code).stderr
    assert not out.parent.exists()


def test_nothing_is_replaced_unasked(run: Run, pair: Path, tmp_path: Path) -> None:
    args = ["rig", "map", tmp_path / "a.npz", "-m", pair, "--size", "32x24"]
    (tmp_path / "a.stereo.yaml").write_text("mine")
    assert "a.stereo.yaml exists" in run(*args, code=1).stderr
    assert len(list(tmp_path.iterdir())) == 1
    run(*args, "--overwrite")
    assert (tmp_path / "a.stereo.yaml").read_text() != "mine"
