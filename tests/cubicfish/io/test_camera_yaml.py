"""camera.yaml: an exact round trip, and one line for whatever is wrong with a file."""

import json
import subprocess
import sys

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from lenses import cubic_camera, random_rays

from cubicfish import (
    CameraFile,
    CameraFileError,
    OutputError,
    load_camera,
    save_camera,
)
from cubicfish.io.camera_yaml import PointCameraFile, camera_text
from cubicfish.judge import FitRecord
from cubicfish.models import PointCamera

FIT = {"rms_px": 0.1, "per_image": [{"image": "ä b.png", "corners": 3}], "held_out_rms_px": None}
MADE_BY = {"version": "0", "options": {"target": "no"}}


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(camera_text(cubic_camera(), fit=FitRecord.of(FIT), made_by=MADE_BY))
    return path


def test_round_trip_is_exact(path):
    camera, loaded = cubic_camera(), load_camera(path)
    np.testing.assert_array_equal(loaded.camera.P, camera.P)
    np.testing.assert_array_equal(loaded.camera.radial.parameters, camera.radial.parameters)
    assert loaded.camera.max_angle_deg == camera.max_angle_deg
    assert loaded.camera.image_size == camera.image_size
    assert loaded.fit == FitRecord.of(FIT)
    assert loaded.made_by == MADE_BY


@pytest.mark.slow
@settings(max_examples=20)
@given(st.integers(0, 10**6), st.floats(30, 110))
def test_round_trip_of_random_cameras(tmp_path_factory, seed, angle):
    camera = cubic_camera(angle, bend=0.0005, seed=seed)
    path = tmp_path_factory.mktemp("c") / "camera.yaml"
    path.write_text(camera_text(camera, fit=FitRecord(), made_by={}))
    np.testing.assert_array_equal(load_camera(path).camera.P, camera.P)


def test_keys_are_the_promised_ones(path):
    record = yaml.safe_load(path.read_text())
    assert list(record) == [
        "cubicfish", "image_size", "lift", "frame", "P", "max_angle_deg", "valid", "radial",
        "fit", "made_by",
    ]  # fmt: skip
    assert record["cubicfish"] == 1
    assert (record["lift"], record["frame"]) == ("ray", "camera")
    assert np.linalg.norm(record["P"]) == pytest.approx(1, abs=1e-12)


def test_a_reader_needs_numpy_alone(path):
    """The camera is usable without this package."""
    code = """
import sys, numpy as np, yaml
P = np.array(yaml.safe_load(open(sys.argv[1], encoding="utf-8"))["P"])
X, Y, Z = np.array([0.6, -0.48, 0.64])
phi = [X**3, Y**3, Z**3, X*X*Y, X*X*Z, Y*Y*X, Y*Y*Z, Z*Z*X, Z*Z*Y, X*Y*Z,
       X*X, Y*Y, Z*Z, X*Y, Y*Z, X*Z, X, Y, Z, 1]
u, v, w = P @ phi
print(u / w, v / w)
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    expected = cubic_camera().project([0.6, -0.48, 0.64])
    np.testing.assert_allclose(np.array(done.stdout.split(), float), expected, atol=1e-9)


def test_never_written_over_unasked(path):
    before = path.read_bytes()
    with pytest.raises(OutputError, match="overwrite=True"):
        save_camera(path, cubic_camera(seed=1), overwrite=False)
    assert path.read_bytes() == before
    save_camera(path, cubic_camera(seed=1), overwrite=True)
    assert path.read_bytes() != before


def _changed(path, change):
    record = yaml.safe_load(path.read_text())
    change(record)
    path.write_text(json.dumps(record))  # JSON is YAML


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.pop("cubicfish"), "not a camera file"),
        (lambda r: r.update(cubicfish=2), "version 2 is not 1"),
        (lambda r: r.update(cubicfish=True), "version True"),
        (lambda r: r.pop("P"), "no key 'P'"),
        (lambda r: r.update(P=[[1.0] * 20] * 2), "P must be 3 x 20 numbers"),
        (lambda r: r.update(P=[[float("nan")] * 20] * 3), "P must be"),
        (lambda r: r.update(P=[["1"] * 20] * 3), "P must be"),
        (lambda r: r.update(P=[[10**200] * 20] * 3), "P must be"),
        (lambda r: r.update(P=[[0.0] * 20] * 3), "all zeros"),
        (lambda r: r.update(image_size=[960.5, 720]), "image_size"),
        (lambda r: r.update(image_size=[960]), "image_size"),
        (lambda r: r.update(image_size=[0, 720]), "image_size"),
        (lambda r: r.update(max_angle_deg=0), "max_angle_deg"),
        (lambda r: r.update(max_angle_deg=True), "max_angle_deg"),
        (lambda r: r["radial"].pop("k3"), "k3"),
        (lambda r: r["radial"].update(fx=-1), "above 0"),
        (lambda r: r.update(radial=[1]), "radial"),
        (lambda r: r.update(lift="cube"), "lift"),
        (lambda r: r.update(lift="point"), "point_"),
        (lambda r: r.update(fitt={}), "did you mean 'fit'"),
        (lambda r: r["P"][2].reverse(), "pole or a fold"),
    ],
)
def test_refusals_name_file_and_key(path, change, message):
    _changed(path, change)
    with pytest.raises(CameraFileError, match=message) as caught:
        load_camera(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "3", "[1, 2]", "\x00\x01", "a: [", "a: &x 1\nb: *x"])
def test_what_is_no_camera_file_is_refused(tmp_path, text):
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    with pytest.raises(CameraFileError) as caught:
        load_camera(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "is empty"),
        ("units: mm\nboards: []\n", "is a calibration target, not a camera"),
        ("hello: 1\n", "is not a camera file (it has no key 'cubicfish')"),
    ],
)
def test_what_is_no_camera_file_says_what_to_name(tmp_path, text, what):
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(CameraFileError) as refused:
        load_camera(file)
    name = f"{file} {what}: name the camera.yaml that 'cubicfish calibrate' wrote"
    other = ", or read another tool's with 'cubicfish import'" * ("no key" in what)
    assert str(refused.value) == name + other


@pytest.mark.parametrize(
    "text",
    ["%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n", "camera_matrix: 1\n", "{fl_x: 1}\n"],
)
def test_it_is_said_how_a_file_of_another_tool_is_taken_over(tmp_path, text):
    file = tmp_path / "theirs.yaml"
    file.write_text(text)
    with pytest.raises(CameraFileError, match="read another tool's with 'cubicfish import'"):
        load_camera(file)


def test_missing_file(tmp_path):
    with pytest.raises(CameraFileError, match="does not exist: check the name"):
        load_camera(tmp_path / "none.yaml")


def test_records_that_share_parts_are_written_out(tmp_path):
    """YAML would write the second as an alias, which the reader refuses."""
    shared = {"corners": [1, 2, 3]}
    path, twice = tmp_path / "camera.yaml", {"a": shared, "b": shared}
    path.write_text(camera_text(cubic_camera(), fit=FitRecord(), made_by=twice))
    assert load_camera(path).made_by == twice


def test_projection_is_the_loaded_cameras(path):
    rays = random_rays(95, 100)
    np.testing.assert_array_equal(
        load_camera(path).camera.project(rays), cubic_camera().project(rays)
    )
    assert (
        camera_text(load_camera(path).camera, fit=FitRecord.of(FIT), made_by=MADE_BY)
        == path.read_text()
    )


@pytest.mark.parametrize(("frame", "vanishing"), [("world", 1), ("camera", 0)])
def test_round_trip_of_the_point_lift(tmp_path, frame, vanishing):
    rng = np.random.default_rng(0)
    P = rng.standard_normal((3, 20))
    camera = PointCamera(
        image_size=(960, 720),
        P=P / np.linalg.norm(P),
        frame=frame,
        offset=rng.standard_normal(3),
        scale=123.4,
        null=np.eye(20)[:vanishing],
        extent=2.5,
        valid=np.array([[1.0, 2], [30, 4], [5, 60.5]]),
    )
    path = tmp_path / "camera.yaml"
    path.write_text(camera_text(camera, fit=FitRecord.of(FIT), made_by=MADE_BY))
    loaded = load_camera(path, any_lift=True)
    assert isinstance(loaded, PointCameraFile)
    for name in ("P", "offset", "scale", "null", "extent", "valid", "frame", "image_size"):
        np.testing.assert_array_equal(getattr(loaded.camera, name), getattr(camera, name))
    assert loaded.camera.rank == 20 - vanishing
    assert (loaded.fit, loaded.made_by) == (FitRecord.of(FIT), MADE_BY)
    with pytest.raises(CameraFileError, match=r"no rays: .* calibrate with lift='ray'"):
        load_camera(path)


def test_the_ray_lift_is_read_whichever_may_be_there(path):
    loaded = load_camera(path, any_lift=True)
    assert isinstance(loaded, CameraFile)
    np.testing.assert_array_equal(loaded.camera.P, load_camera(path).camera.P)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: r.pop("point_offset"), "point_offset"),
        (lambda r: r.update(point_scale=0), "point_scale"),
        (lambda r: r.update(point_null=[[1, 2]]), "point_null"),
        (lambda r: r.update(point_null=3), "point_null"),
        (lambda r: r.update(frame="room"), "frame"),
    ],
)
def test_a_broken_point_file_is_refused(tmp_path, change, said):
    camera = PointCamera(
        image_size=(96, 72),
        P=np.ones((3, 20)),
        frame="world",
        offset=np.zeros(3),
        scale=1.0,
        null=np.zeros((0, 20)),
        extent=1.0,
        valid=np.zeros((3, 2)),
    )
    record = yaml.safe_load(camera_text(camera, fit=FitRecord(), made_by={}))
    change(record)
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(record))
    with pytest.raises(CameraFileError, match=said):
        load_camera(tmp_path / "camera.yaml", any_lift=True)
