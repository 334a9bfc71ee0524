"""COLMAP's cameras, as text and binary, beside COLMAP itself."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from lenses import cubic_camera, radial_camera

from cubicfish import CameraFileError
from cubicfish.fit import from_lens, to_lens
from cubicfish.models import RadialCamera
from cubicfish_cli.extensions.formats.colmap_cameras import (
    MODELS,
    RadTanThinPrismLens,
    colmap_text,
    read_colmap,
)
from cubicfish_cli.foreign.file_contents import PlacedLens
from cubicfish_cli.foreign.foreign_files import sniffed

SIZE = (640, 480)
# Some of each parameter that is not 0: pixels of lenses that look like lenses.
SHAPES = {
    "k": -0.02, "k1": -0.03, "k2": 0.004, "k3": -3e-4, "k4": 2e-5, "k5": 1e-5, "k6": -2e-6,
    "k0": -0.04, "p0": 3e-3, "p1": -2e-3, "p2": 1.5e-3, "s0": 1e-3, "s1": -2e-3, "s2": 5e-4,
    "s3": 2e-4, "sx1": 1e-3, "sy1": -5e-4,
}  # fmt: skip
CORE = {"f": 205.0, "fx": 205.0, "fy": 207.5, "cx": 331.25, "cy": 236.5}


def points() -> np.ndarray:
    theta, azimuth = np.meshgrid(np.deg2rad(np.linspace(0.6, 85, 25)), np.linspace(0, 6, 17))
    rays = [np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)]
    return 1.7 * np.append(np.stack([axis.ravel() for axis in rays], -1), [[0, 0, 1]], axis=0)


def their_cameras(pycolmap, folder: Path) -> dict:
    """A camera of each model that both know, written by COLMAP both ways."""
    reconstruction, cameras = pycolmap.Reconstruction(), {}
    there = pycolmap.CameraModelId.__members__
    for number, name in enumerate(set(MODELS) & set(there), start=1):
        camera = pycolmap.Camera.create_from_model_id(number, there[name], 200.0, *SIZE)
        keys = camera.params_info.split(", ")
        camera.params = [{**CORE, **SHAPES}[key] for key in keys]
        reconstruction.add_camera(camera)
        cameras[str(number)] = camera
    reconstruction.write_text(str(folder))
    reconstruction.write_binary(str(folder))
    return cameras


@pytest.mark.parametrize("file", ["cameras.txt", "cameras.bin"])
def test_every_model_is_read_as_colmap_means_it(tmp_path, file):
    pycolmap = pytest.importorskip("pycolmap")
    cameras = their_cameras(pycolmap, tmp_path)
    assert len(cameras) >= 10
    assert sniffed(tmp_path / file) == "colmap"
    seen = points()
    for number, camera in cameras.items():
        lens = read_colmap(tmp_path / file, camera=number)
        assert lens.image_size == SIZE
        theirs = np.asarray(camera.img_from_cam(seen)) - 0.5
        ours = lens.project(seen)
        inside = np.isfinite(ours[:, 0])
        assert inside.mean() > 0.5, camera.model
        np.testing.assert_allclose(ours[inside], theirs[inside], atol=1e-9, rtol=0)


@pytest.mark.parametrize("model", [RadialCamera, RadTanThinPrismLens], ids=lambda kind: kind.name)
def test_colmap_projects_what_is_written_the_same(tmp_path, model):
    pycolmap = pytest.importorskip("pycolmap")
    written = to_lens(cubic_camera(80, bend=0.001), model).lens
    path = tmp_path / "cameras.txt"
    path.write_text(colmap_text(PlacedLens(lens=written, note=["a note"])))
    _, name, width, height, *params = path.read_text().splitlines()[-1].split()
    if name not in pycolmap.CameraModelId.__members__:
        pytest.skip(f"this pycolmap does not know {name}")
    camera = pycolmap.Camera(
        model=name, width=int(width), height=int(height), params=[float(v) for v in params]
    )
    assert camera.verify_params()
    assert not camera.has_bogus_params(0.1, 10.0, 10.0)
    seen = points()
    theirs = np.asarray(camera.img_from_cam(seen)) - 0.5
    for lens in (written, read_colmap(path)):
        np.testing.assert_allclose(lens.project(seen), theirs, atol=1e-9, rtol=0)


@pytest.mark.slow
def test_a_lens_with_prisms_is_found_again():
    """Those of a real lens are a few times smaller."""
    values = {
        "fx": 205.0, "fy": 207.5, "cx": 322.0, "cy": 236.5, "t": np.array([1.5e-3, -1e-3]),
        "k": np.array([-0.03, 4e-3, -3e-4, 0, 0, 0]), "s": np.array([1e-3, -1e-3, 5e-4, 2e-4]),
    }  # fmt: skip
    truth = RadTanThinPrismLens(image_size=SIZE, **values)
    imported = from_lens(truth, max_angle_deg=80)
    assert to_lens(imported.camera, RadialCamera).error.rms_px > 0.2
    assert to_lens(imported.camera, RadTanThinPrismLens).error.max_px < imported.error.max_px + 0.01


def test_prisms_of_a_radial_lens_are_nothing():
    radial = radial_camera(85)
    lens = to_lens(cubic_camera(85, bend=0), RadTanThinPrismLens).lens
    np.testing.assert_allclose([*lens.t, *lens.s], 0, atol=1e-4)
    np.testing.assert_allclose(lens.fx, radial.fx, rtol=1e-3)


def test_beyond_its_fold_a_lens_sees_nothing():
    k = np.zeros(6)
    k[0] = -0.2  # θ - 0.2 θ³ grows up to 74.0°
    core = {"fx": 200.0, "fy": 200.0, "cx": 320.0, "cy": 240.0}
    lens = RadTanThinPrismLens(image_size=SIZE, **core, k=k, t=np.zeros(2), s=np.zeros(4))
    theta = np.deg2rad([0.0, 73.5, 74.5, 120, 180])
    seen = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], -1)
    pixel = lens.project(seen)
    np.testing.assert_array_equal(np.isfinite(pixel[:, 0]), [True, True, False, False, False])


def test_a_term_of_next_to_nothing_is_none(tmp_path):
    path = tmp_path / "cameras.txt"
    values = "200 200 320 240 -0.05 0.002 1e-5"
    pixel = []
    for term in ("0", "1e-310"):
        path.write_text(f"1 OPENCV_FISHEYE 640 480 {values} {term}\n")
        pixel.append(read_colmap(path).project(points()))
    np.testing.assert_array_equal(*pixel)


def test_without_its_remarks_the_file_is_known_too(tmp_path):
    path = tmp_path / "cameras.txt"
    path.write_text("2 SIMPLE_PINHOLE 640 480 200 320 240\n")
    assert sniffed(path) == "colmap"
    assert read_colmap(path).cx == 319.5


def binary(*cameras: tuple[int, int, list[float]]) -> bytes:
    rows = (
        struct.pack(f"<IiQQ{len(params)}d", number, model, *SIZE, *params)
        for number, model, params in cameras
    )
    return struct.pack("<Q", len(cameras)) + b"".join(rows)


PINHOLE = [200.0, 200.0, 320.0, 240.0]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (binary((1, 1, PINHOLE))[:-3], "ends before all of its 1 cameras"),
        (binary((1, 1, PINHOLE), (2, 1, PINHOLE))[:-40], "ends before all of its 2 cameras"),
        (binary((1, 1, PINHOLE)) + b"x", "more behind its 1 cameras"),
        (binary((1, 1, PINHOLE), (1, 1, PINHOLE)), "camera '1' is there twice"),
        (binary((1, 1, PINHOLE), (7, 1, PINHOLE)), "--camera: 1, 7"),
        (binary((1, 99, PINHOLE)), "model number 99, which is not known here: known: SIMPLE_PIN"),
        (
            binary((1, 17, [640, 480])),
            "model number 17, which is not known",
        ),
        (binary((1, 1, [np.nan, 1, 1, 1])), "PARAMS of PINHOLE must hold 4 finite numbers"),
        (binary((1, 1, [-1, 1, 1, 1])), "focal lengths must be above 0"),
        (b"1 PINHOLE 640 480 1 1 1 1\n1 PINHOLE 640 480 1 1 1 1\n", "line 2: camera '1' is there"),
        (
            b"1 EUCM 640 480 1 1 1 1 1 1\n",
            "the lens of COLMAP's 'EUCM' is not known here: known: SIM",
        ),
        (b"1 PINHOLE 640\n", "WIDTH, HEIGHT and numbers must follow"),
        (b"# only remarks\n", "--camera: none"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(tmp_path, data, message):
    path = tmp_path / "cameras"
    path.write_bytes(data)
    with pytest.raises(CameraFileError, match=re.escape(message)) as refused:
        read_colmap(path)
    assert "\n" not in str(refused.value)


def test_of_several_cameras_one_is_chosen(tmp_path):
    path = tmp_path / "cameras.bin"
    path.write_bytes(binary((1, 1, PINHOLE), (7, 0, [150.0, 320.0, 240.0])))
    assert read_colmap(path, camera="7").fx == 150
