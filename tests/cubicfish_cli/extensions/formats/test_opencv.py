"""OpenCV's FileStorage in its three syntaxes, as OpenCV writes it and as people do."""

import json
import re

import cv2
import numpy as np
import pytest

from cubicfish import CameraFileError
from cubicfish_cli.extensions.formats.opencv_cameras import read_file_storage, read_opencv
from cubicfish_cli.foreign.foreign_files import read_foreign, sniffed

K = np.array([[401.25, 0, 320.5], [0, 399.5, 239.0], [0, 0, 1]])
D4 = np.array([[-0.02], [0.003], [-4e-4], [1e-5]])
D5 = np.array([[-0.2, 0.05, 0.001, -0.0005, 0.01]])
SYNTAXES = ("yml", "xml", "json")


def stored(path, **values):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()
    return path


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_what_opencv_writes_is_read_to_the_last_bit(tmp_path, syntax):
    path = stored(
        tmp_path / f"camera.{syntax}", calibration_time="Fri 20 Nov 2026", image_width=640,
        image_height=480, fisheye_model=1, camera_matrix=K, distortion_coefficients=D4,
        per_view=np.zeros((0, 0)), poses=np.full((3, 6), 0.5), few=7.5,
    )  # fmt: skip
    assert sniffed(path) == "opencv"
    lens = read_opencv(path)
    assert lens.name == "kannala_brandt"
    assert lens.image_size == (640, 480)
    assert [lens.fx, lens.fy, lens.cx, lens.cy] == [401.25, 399.5, 320.5, 239]
    np.testing.assert_array_equal(lens.k, D4[:, 0])
    data = read_file_storage(path)
    assert data["calibration_time"] == "Fri 20 Nov 2026"
    assert data["few"] == 7.5
    assert len(data["poses"]["data"]) == 18


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_a_pinhole_without_a_size_takes_it_from_outside(tmp_path, syntax):
    path = stored(tmp_path / f"camera.{syntax}", K=K, D=D5)
    lens, name = read_foreign(path, image_size=(640, 480))
    assert (name, lens.name, lens.image_size) == ("opencv", "pinhole", (640, 480))
    np.testing.assert_array_equal(lens.d, D5[0])
    with pytest.raises(CameraFileError, match="add --size WxH"):
        read_foreign(path)


def test_a_size_that_contradicts_the_file_is_refused(tmp_path):
    path = stored(tmp_path / "camera.yml", K=K, D=D5, image_width=640, image_height=480)
    with pytest.raises(CameraFileError, match="photos of 640x480 pixels, not of --size 480x640"):
        read_foreign(path, image_size=(480, 640))


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_cameras_of_a_pair_are_told_apart(tmp_path, syntax):
    other = K + np.array([[0, 0, 4], [0, 0, 0], [0, 0, 0]])
    size = {"image_size": np.array([640.0, 480.0])}
    path = stored(tmp_path / f"intrinsics.{syntax}", M1=K, D1=D5, M2=other, D2=2 * D5, **size)
    assert read_opencv(path, camera="1").cx == 320.5
    second = read_opencv(path, camera="2")
    assert second.cx == 324.5
    np.testing.assert_array_equal(second.d, 2 * D5[0])
    for camera in (None, "3", ""):
        with pytest.raises(CameraFileError, match=r"its cameras with --camera: 1, 2$"):
            read_opencv(path, camera=camera)


def test_a_camera_that_is_called_otherwise_is_named_as_it_is(tmp_path):
    path = tmp_path / "profile.json"
    path.write_text(json.dumps({"parameters": {"camera_matrix": K.tolist()}}))
    with pytest.raises(CameraFileError, match=r"no distortion .* go with 'camera_matrix'"):
        read_opencv(path)


@pytest.mark.parametrize(
    ("matrix", "coefficients"),
    [
        ("K", "D"),
        ("cameraMatrix", "distCoeffs"),
        ("Camera_Matrix", "Distortion_Coefficients"),
        ("mtx", "dist"),
        ("intrinsic_matrix", "distortion"),
        ("intrinsics", "distortion_coeffs"),
    ],
)
@pytest.mark.parametrize("nested", [True, False])
def test_names_that_people_use(tmp_path, matrix, coefficients, nested):
    path = tmp_path / "camera"
    rows = K.tolist() if nested else K.ravel().tolist()
    data = {matrix: rows, coefficients: D5.tolist(), "resolution": [640, 480]}
    path.write_text(json.dumps(data))
    assert sniffed(path) == "opencv"
    assert read_opencv(path).fy == 399.5
    path.write_text("\n".join(f"{key}: {value}" for key, value in data.items()))
    assert sniffed(path) == "opencv"
    np.testing.assert_array_equal(read_opencv(path).d, D5[0])
    path.write_text(json.dumps({"left": data, "right": data}))
    assert read_opencv(path, camera="left").image_size == (640, 480)
    with pytest.raises(CameraFileError, match=r"--camera: left, right$"):
        read_opencv(path)
    path.write_text(json.dumps({f"left_{key}": value for key, value in data.items()}))
    assert sniffed(path) == "opencv"
    assert read_opencv(path).cx == 320.5


def test_an_omnidir_lens_projects_as_its_formula_says(tmp_path):
    skewed = K + np.array([[0, 2.5, 0], [0, 0, 0], [0, 0, 0]])
    d = np.array([[-0.1, 0.02, 1e-3, -2e-3]])
    path = stored(
        tmp_path / "omni.xml", camera_matrix=skewed, D=d, xi=np.array([[1.1]]),
        image_size=np.array([640.0, 480.0]),
    )  # fmt: skip
    lens = read_opencv(path)
    assert lens.name == "unified"
    point = np.array([0.5, -0.3, 0.8])
    x, y, z = point / np.linalg.norm(point)
    x, y = x / (z + 1.1), y / (z + 1.1)
    r2, (k1, k2, p1, p2) = x * x + y * y, d[0]
    bent = [
        x * (1 + k1 * r2 + k2 * r2 * r2) + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * (1 + k1 * r2 + k2 * r2 * r2) + 2 * p2 * x * y + p1 * (r2 + 2 * y * y),
        1,
    ]
    pixel = lens.project(point)
    np.testing.assert_allclose(pixel, (skewed @ bent)[:2], atol=1e-10)


def test_a_skewed_fisheye_projects_as_opencv_does(tmp_path):
    skewed = K + np.array([[0, 2.5, 0], [0, 0, 0], [0, 0, 0]])
    path = stored(
        tmp_path / "camera.yml",
        K=skewed,
        D=D4,
        fisheye_model=1,
        image_size=np.array([640.0, 480.0]),
    )
    points = np.array([[0.5, -0.3, 0.8], [-1.0, 0.2, 0.6]])
    pixel, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), skewed, D4, alpha=skewed[0, 1] / skewed[0, 0]
    )
    np.testing.assert_allclose(read_opencv(path).project(points), pixel[:, 0], atol=1e-9)


XML = '<?xml version="1.0"?>\n<opencv_storage>\n{}\n</opencv_storage>\n'
GOOD = {"K": K.ravel().tolist(), "D": [0, 0, 0, 0, 0], "image_size": [640, 480]}


def with_(**changes) -> str:
    return json.dumps({**GOOD, **changes})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE a [<!ENTITY b "c">]>\n<a>&b;</a>', ": document types"),
        ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><opencv_storage/>', ": document types"),
        (XML.format("<K>&b;</K>"), "line 3: not valid XML: undefined entity"),
        (XML.format("<K>1</K><K>2</K>"), "'opencv_storage' holds text, a list and names beside"),
        (XML.format("<a>" * 20 + "</a>" * 20), "nested more than 12"),
        (XML.format("<K>1<x>2</x></K>"), "'K' holds text, a list and names beside"),
        (XML.format("<K><_>1</_><x>2</x></K>"), "'K' holds text, a list and names beside"),
        (XML.format("<K>1"), "not valid XML: mismatched tag"),
        ("<camera><K>1</K></camera>", "the outermost element is 'camera', not opencv_storage"),
        (XML.format(""), "has no camera matrix under a name that is known"),
        ('{"K": 1, "K": 2}', "the key 'K' is there twice"),
        ('{"K": [NaN]}', "NaN is not a finite number"),
        ('{"K": [1', "line 1: not valid JSON"),
        ('{"K": ' + "[" * 100_000, "not the JSON of a camera"),
        ('{"K": [' + "9" * 5000 + "]}", "not the JSON of a camera"),
        ("[1, 2]", "must hold keys and values"),
        ("K: [1]\nK: [2]\n", "line 2: the key 'K' is there twice"),
        (with_(K=K.T.ravel().tolist()), "was it written column by column?"),
        (with_(K=[1, 2]), "K must hold 9 finite numbers"),
        (with_(K={"rows": 3, "cols": 4, "data": [1] * 9}), "'K' holds 9 numbers, not rows times"),
        (with_(K={"data": "$base64$AAAA"}), "packed in base 64"),
        (with_(camera_matrix=[1] * 9), "'K' and 'camera_matrix' are not the same"),
        (with_(D=[0] * 6), "D must hold 0 or 4 or 5 or 8"),
        (with_(D=[0] * 4), "four distortion coefficients are a fisheye's or a pinhole's"),
        (with_(model="fisheye"), "has 4 distortion coefficients, not 5"),
        (with_(model="Logitech"), "'model' 'Logitech' is not known: fisheye, equidistant"),
        (with_(fisheye_model=2), "'fisheye_model' must be 0 or 1"),
        (with_(image_size=[640, 480.5]), "image_size must be two whole numbers"),
        (with_(D=None), "no distortion coefficients that go with 'K'"),
        (with_(xi="a", D=[0] * 4), "xi must hold 1 finite numbers"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(tmp_path, text, message):
    path = tmp_path / "camera"
    path.write_text(text)
    with pytest.raises(CameraFileError, match=re.escape(message)) as refused:
        read_foreign(path, name="opencv")
    assert "\n" not in str(refused.value)


def test_a_file_of_another_encoding_than_it_says_is_read_as_what_it_is(tmp_path):
    path = tmp_path / "camera.xml"
    path.write_text(
        '<?xml version="1.0" encoding="utf-16"?><opencv_storage><a>é</a></opencv_storage>'
    )
    assert read_file_storage(path) == {"a": "é"}
