"""Rigs for other tools, read back by the tools or by their formulas."""

import ast
import json
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from mrcal_itself import ask_mrcal, needs_mrcal
from reference import keys_of
from running import Run
from scipy.spatial.transform import Rotation

from cubicfish.models import RadialCamera
from cubicfish_cli import Rig, load_rig
from cubicfish_cli.commands.export import FORMATS
from cubicfish_cli.extension_guard import written_formats
from cubicfish_cli.extensions.formats.anipose_toml import anipose_rig_text
from cubicfish_cli.foreign.file_contents import LensRig, PlacedLens
from tests.cubicfish_cli.commands.test_export import kannala_brandt, project_kalibr

TURNS = [(0.0, 0.0, 0.0), (0.03, -0.4, 0.05), (0.1, 2.9, 0.0)]
SHIFTS = [(0.0, 0.0, 0.0), (-120.0, 3.0, 20.0), (10.0, -5.0, -60.0)]
NAMES = ("left", "right", "rear cam")


def made_rig(calibrated: Path, folder: Path, count: int, units: str | None = "mm") -> Path:
    """A rig.yaml of cameras that all have the sample's lens."""
    cameras = []
    for name, turn, shift in list(zip(NAMES, TURNS, SHIFTS, strict=True))[:count]:
        (folder / name).mkdir(parents=True)
        text = (calibrated / "camera.yaml").read_text()
        (folder / name / "camera.yaml").write_text(text)
        place = {
            "rotation": Rotation.from_rotvec(turn).as_matrix().tolist(),
            "translation": list(shift),
        }
        camera = {"name": name, "camera": f"{name}/camera.yaml", "camera_from_rig": place}
        cameras.append(camera)
    record = {"cubicfish_rig": 1, "units": units, "cameras": cameras}
    (folder / "rig.yaml").write_text(yaml.safe_dump(record))
    return folder / "rig.yaml"


@pytest.fixture(scope="module")
def pair(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_rig(calibrated, tmp_path_factory.mktemp("pair"), 2)


@pytest.fixture(scope="module")
def three(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_rig(calibrated, tmp_path_factory.mktemp("three"), 3)


def exported(run: Run, rig: Path, path: Path, name: str) -> dict:
    said = run("rig", "export", rig, "--to", name, "-o", path, "--max-error", 3, "--json").stdout
    record: dict = json.loads(said)
    assert set(record) <= set(keys_of("rig export"))
    return record


def stated_px(record: dict) -> float:
    """The largest error that was stated, of any camera."""
    cameras = record["cameras"]
    return 1.02 * max(max(one["max_px"], one.get("beyond", one)["max_px"]) for one in cameras)


def seen(rig: Rig, number: int, *, ahead: float = -1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of the rig's frame in a camera's field, near and far, and their pixels."""
    camera = rig.cameras[number]
    width, height = camera.camera.image_size
    grid = np.stack(np.meshgrid(np.linspace(0, width, 31), np.linspace(0, height, 23)), -1)
    rays = camera.camera.unproject(grid.reshape(-1, 2))
    rays = rays[np.isfinite(rays[:, 0]) & (rays[:, 2] > ahead)]
    own = rays * np.linspace(200, 3000, len(rays))[:, None]
    return (own - camera.translation) @ camera.rotation, camera.camera.project(own)


def largest(pixel: np.ndarray, true: np.ndarray) -> float:
    return float(np.linalg.norm(pixel - true, axis=1).max())


def test_rig_formats_are_formats() -> None:
    assert {name for name, made in written_formats().items() if made.write_rig} < set(FORMATS)


@pytest.mark.slow
def test_kalibr_chains_the_cameras(run: Run, three: Path, tmp_path: Path) -> None:
    record = exported(run, three, tmp_path / "camchain.yaml", "kalibr-omni")
    chain = yaml.safe_load((tmp_path / "camchain.yaml").read_text())
    assert [chain[f"cam{n}"]["cam_overlaps"] for n in range(3)] == [[1, 2], [0, 2], [0, 1]]
    # cam0 is the first lens's frame, which is turned against the rig's.
    rig = load_rig(three)
    whole = np.eye(4)
    whole[:3, :3] = np.array(record["cameras"][0]["lens_from_camera"])
    for number in range(3):
        cam = chain[f"cam{number}"]
        whole = np.array(cam.get("T_cn_cnm1", np.eye(4))) @ whole
        points, true = seen(rig, number)
        own = points / 1000 @ whole[:3, :3].T + whole[:3, 3]
        assert largest(project_kalibr(cam, own), true) <= stated_px(record)


@pytest.mark.slow
def test_opencv_rectifies_by_it_and_measures(run: Run, pair: Path, tmp_path: Path) -> None:
    record = exported(run, pair, tmp_path / "stereo.yaml", "opencv")
    storage = cv2.FileStorage(str(tmp_path / "stereo.yaml"), cv2.FILE_STORAGE_READ)
    names = ("M1", "D1", "M2", "D2", "R", "T", "R1", "R2", "P1", "P2", "Q")
    held = {name: storage.getNode(name).mat() for name in names}
    assert storage.getNode("image_width2").real() == 960
    storage.release()
    rig = load_rig(pair)
    points, _ = seen(rig, 0, ahead=0.3)
    turns = [np.array(one["lens_from_camera"]) for one in record["cameras"]]
    first = points @ turns[0].T
    second = first @ held["R"].T + held["T"].ravel()
    own = points @ rig.cameras[1].rotation.T + rig.cameras[1].translation
    np.testing.assert_allclose(second, own @ turns[1].T, atol=1e-6)
    ahead = (first[:, 2] > 100) & (second[:, 2] > 100)
    flat, zero = [], np.zeros(3)
    for number, at in enumerate((first[ahead], second[ahead]), start=1):
        lens, d, turn, plane = (held[f"{name}{number}"] for name in "MDRP")
        pixel, _ = cv2.fisheye.projectPoints(at[:, None], zero, zero, lens, d)
        true = rig.cameras[number - 1].camera.project(at @ turns[number - 1])
        assert largest(pixel[:, 0], true) <= stated_px(record)
        flat.append(cv2.fisheye.undistortPoints(pixel, lens, d, R=turn, P=plane)[:, 0])
    inner = (np.abs(flat[0] - 480) < 1500).all(axis=1) & (np.abs(flat[1] - 480) < 1500).all(axis=1)
    assert inner.sum() > 100
    np.testing.assert_allclose(flat[0][inner, 1], flat[1][inner, 1], atol=1e-3)
    columns = np.column_stack([flat[0], flat[0][:, 0] - flat[1][:, 0], np.ones(len(flat[0]))])
    four = columns[inner] @ held["Q"].T
    true = first[ahead][inner] @ held["R1"].T
    np.testing.assert_allclose(four[:, :3] / four[:, 3:], true, rtol=1e-3, atol=1)
    # P2 and Q are of one baseline, that of T.
    baseline = -held["P2"][0, 3] / held["P2"][0, 0]
    assert abs(baseline) == pytest.approx(np.linalg.norm(held["T"]))
    assert held["Q"][3, 2] == pytest.approx(1 / baseline)


@pytest.mark.slow
def test_colmap_reads_rig_and_cameras(run: Run, three: Path, tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    if not hasattr(pycolmap, "read_rig_config"):
        pytest.skip("a pycolmap before rigs")
    record = exported(run, three, tmp_path / "rig_config.json", "colmap")
    (config,) = pycolmap.read_rig_config(tmp_path / "rig_config.json")
    rig = load_rig(three)
    turn = np.array(record["cameras"][0]["lens_from_camera"])
    for number, camera in enumerate(config.cameras):
        assert camera.image_prefix == f"{NAMES[number]}/"
        assert camera.ref_sensor == (number == 0)
        points, true = seen(rig, number, ahead=0.1)
        own = points @ turn.T
        if number:
            own = own @ camera.cam_from_rig.rotation.matrix().T + camera.cam_from_rig.translation
        pixel = np.asarray(camera.camera.img_from_cam(own)) - 0.5
        assert largest(pixel, true) <= stated_px(record)


@pytest.mark.slow
def test_ros_places_every_lens(run: Run, three: Path, tmp_path: Path) -> None:
    record = exported(run, three, tmp_path / "ros", "ros")
    assert {Path(file).name for file in record["files"]} == {
        "static_transforms.yaml", "rig.urdf", *(f"{name}.camera_info.yaml" for name in NAMES)
    }  # fmt: skip
    rig = load_rig(three)
    transforms = yaml.safe_load((tmp_path / "ros" / "static_transforms.yaml").read_text())
    joints = ET.parse(tmp_path / "ros" / "rig.urdf").getroot().findall("joint")
    for number, (one, joint) in enumerate(zip(transforms, joints, strict=True)):
        assert one["header"]["frame_id"] == joint.find("parent").get("link") == "rig"
        frame = ("left", "right", "rear_cam")[number] + "_optical_frame"
        assert one["child_frame_id"] == joint.find("child").get("link") == frame
        shift = np.array([one["transform"]["translation"][axis] for axis in "xyz"])
        turn = Rotation.from_quat([one["transform"]["rotation"][axis] for axis in "xyzw"])
        points, true = seen(rig, number)
        own = (points / 1000 - shift) @ turn.as_matrix()  # the transform takes lens to rig
        info = yaml.safe_load((tmp_path / f"ros/{NAMES[number]}.camera_info.yaml").read_text())
        fx, _, cx, _, fy, cy = info["camera_matrix"]["data"][:6]
        pixel = kannala_brandt(own, fx, fy, cx, cy, info["distortion_coefficients"]["data"])
        assert largest(pixel, true) <= stated_px(record)
        origin = joint.find("origin")
        np.testing.assert_allclose([float(v) for v in origin.get("xyz").split()], shift, atol=1e-12)
        roll, pitch, yaw = (float(value) for value in origin.get("rpy").split())
        fixed = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        np.testing.assert_allclose(fixed, turn.as_matrix(), atol=1e-12)


@pytest.mark.slow
def test_mrcal_has_each_camera_from_the_rig(run: Run, pair: Path, tmp_path: Path) -> None:
    exported(run, pair, tmp_path / "mrcal", "mrcal")
    text = (tmp_path / "mrcal" / "right.cameramodel").read_text()
    assert "conversion error: RMS 0.0" in text
    held = ast.literal_eval(text)
    np.testing.assert_allclose(held["extrinsics"][:3], TURNS[1], atol=1e-12)
    np.testing.assert_allclose(held["extrinsics"][3:], np.array(SHIFTS[1]) / 1000, atol=1e-12)


@needs_mrcal
@pytest.mark.slow
def test_mrcal_itself_projects_the_same(run: Run, pair: Path, tmp_path: Path) -> None:
    record = exported(run, pair, tmp_path / "mrcal", "mrcal")
    points, true = seen(load_rig(pair), 1)
    pixel, *_ = ask_mrcal(tmp_path / "mrcal" / "right.cameramodel", points / 1000)
    assert largest(pixel, true) <= stated_px(record)


@pytest.mark.slow
def test_nerfstudio_has_a_lens_and_a_pose_a_photo(run: Run, pair: Path, tmp_path: Path) -> None:
    record = exported(run, pair, tmp_path / "transforms.json", "nerfstudio")
    data = json.loads((tmp_path / "transforms.json").read_text())
    rig = load_rig(pair)
    rows = rig.cameras[1].fit.per_image
    frames = {frame["file_path"]: frame for frame in data["frames"]}
    assert len(frames) == 2 * len(rows)
    frame = frames[f"right/{rows[0].image}"]
    pose = rows[0].camera_from_world
    world = np.array([[60.0, 70.0, 40.0], [200.0, 30.0, 10.0]])
    rotation = Rotation.from_rotvec(pose.rotation_vector).as_matrix()
    own = world @ rotation.T + pose.translation
    theirs = np.linalg.inv(frame["transform_matrix"])
    theirs = (world @ theirs[:3, :3].T + theirs[:3, 3]) * [1, -1, -1]
    core = [frame[key] for key in ("fl_x", "fl_y", "cx", "cy")]
    pixel = kannala_brandt(theirs, *core, [frame[f"k{n}"] for n in (1, 2, 3, 4)]) - 0.5
    assert largest(pixel, rig.cameras[1].camera.project(own)) <= stated_px(record)


@pytest.mark.slow
@pytest.mark.parametrize(("to", "ahead"), [("anipose", 0.1), ("anipose-pinhole", 0.75)])
def test_anipose_sees_every_pixel_where_it_is(
    run: Run, three: Path, tmp_path: Path, to: str, ahead: float
) -> None:
    """As aniposelib's cameras project: tables in the order of their names, metadata left out."""
    path = tmp_path / "calibration.toml"
    angle = [] if to == "anipose" else ["--max-angle", 50]
    said = run("rig", "export", three, "--to", to, "-o", path, "--max-error", 3, "--json", *angle)
    record = json.loads(said.stdout)
    held = tomllib.loads(path.read_text())
    assert held.pop("metadata")["adjusted"] is True
    rig = load_rig(three)
    for number, key in enumerate(sorted(held)):
        one = held[key]
        assert (one["name"], one["size"]) == (NAMES[number], [960, 720])
        assert one["fisheye"] == (to == "anipose")
        points, true = seen(rig, number, ahead=ahead)
        project = cv2.fisheye.projectPoints if one["fisheye"] else cv2.projectPoints
        pose = np.array(one["rotation"]), np.array(one["translation"])
        inside = (np.array(one["matrix"]), np.array(one["distortions"]))
        pixel = project(points[:, None] / 1000, *pose, *inside)[0]
        assert np.linalg.norm(pixel[:, 0] - true, axis=1).max() <= stated_px(record)


def test_a_name_of_any_letters_is_text_of_toml() -> None:
    lens = RadialCamera.from_parameters([300, 300, 319.5, 239.5, 0, 0, 0, 0], (640, 480))
    names = [f'{number} "\\ \x7f é 😀 [x]' for number in range(11)]
    placed = tuple(
        PlacedLens(
            name=name,
            lens=lens,
            note=["a line"],
            rotation=np.eye(3),
            translation=np.array([1000.0 * number, 0, 0]),
            poses={},
        )
        for number, name in enumerate(names)
    )
    rig = LensRig(lenses=placed, units="mm", overlaps=np.ones((11, 11), bool))
    held = tomllib.loads(anipose_rig_text(rig))
    held.pop("metadata")
    assert [held[key]["name"] for key in sorted(held)] == names
    assert [held[key]["translation"][0] for key in sorted(held)] == list(range(11))


@pytest.mark.slow
def test_what_a_format_cannot_hold_is_said(
    run: Run, three: Path, calibrated: Path, tmp_path: Path
) -> None:
    args = ["-o", tmp_path / "x", "--max-error", 3]
    said = run("rig", "export", three, "--to", "opencv", *args, code=1).stderr
    assert "--pair left,right" in said
    said = run("rig", "export", three, "--to", "gyroflow", *args, code=2).stderr
    assert str(three.parent / "left" / "camera.yaml") in said
    said = run(
        "rig", "export", three, "--to", "ros", "--pair", "left,reer cam", *args, code=1
    ).stderr
    assert "did you mean 'rear cam'" in said
    squares = made_rig(calibrated, tmp_path / "squares", 2, units="squares")
    assert "is in 'squares'" in run("rig", "export", squares, "--to", "mrcal", *args, code=1).stderr
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
def test_nothing_is_replaced_unasked(run: Run, pair: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mrcal"
    folder.mkdir()
    (folder / "right.cameramodel").write_text("mine")
    args = ["rig", "export", pair, "--to", "mrcal", "-o", folder]
    assert "right.cameramodel exists" in run(*args, code=1).stderr
    assert [file.name for file in folder.iterdir()] == ["right.cameramodel"]
    run(*args, "--overwrite")
    assert (folder / "right.cameramodel").read_text() != "mine"
    assert len(list(folder.iterdir())) == 2
