"""Camera files of other programs: each is the lens that its program's own formula says."""

import json
import re
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import run_cli

from cubicfish import CameraFileError, UsageError, load_camera
from cubicfish_cli.extensions.formats import camera_keys
from cubicfish_cli.extensions.formats.importing import import_camera
from cubicfish_cli.foreign.foreign_files import read_foreign, sniffed

FILES = Path(__file__).with_name("camera_files")
RAYS = np.array([[0, 0, 1], [0.1, -0.2, 1], [-0.6, 0.4, 0.9], [0.5, 0.7, 0.6], [0.3, 0.9, 0.25]])
NONE = np.zeros(3)


def angles(rays):
    """The angle from the axis, and (x, y) of the same length along the azimuth."""
    rho = np.hypot(*rays[:, :2].T)
    theta = np.arctan2(rho, rays[:, 2])
    return theta, np.divide(theta, rho, out=np.zeros_like(rho), where=rho > 0)[:, None] * rays[
        :, :2
    ]


def brown(x, y, p1, p2):
    r2 = x * x + y * y
    return np.stack(
        [2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], 1
    )


def fisheye(rays, fx, fy, cx, cy, k):
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], float)
    return cv2.fisheye.projectPoints(rays[:, None], NONE, NONE, matrix, np.array(k))[0][:, 0]


def pinhole(rays, fx, fy, cx, cy, d):
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], float)
    return cv2.projectPoints(rays, NONE, NONE, matrix, np.array(d))[0][:, 0]


def double_sphere(rays, fx, fy, cx, cy, xi, alpha):
    """Usenko, Demmel & Cremers 2018, equations 40 to 42."""
    x, y, z = rays.T
    d1 = np.sqrt(x * x + y * y + z * z)
    d2 = np.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    below = alpha * d2 + (1 - alpha) * (xi * d1 + z)
    return rays[:, :2] / below[:, None] * [fx, fy] + [cx, cy]


def mei(rays):
    """camodocal's CataCamera::spaceToPlane."""
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    x, y = rays[:, :2].T / (rays[:, 2] + 1.9)
    r2 = x * x + y * y
    radial = 1 - 0.05 * r2 + 0.3 * r2**2
    bent = np.stack([x, y], 1) * radial[:, None] + brown(x, y, 0.0004, -0.0003)
    return bent * [550, 549] + [318, 321]


def thin_prism(rays):
    """COLMAP's ThinPrismFisheyeCameraModel::Distortion; its pixels begin at a corner."""
    theta, (u, v) = angles(rays)[0], angles(rays)[1].T
    r2 = theta**2
    radial = 0.089 * r2 - 0.040 * r2**2 + 0.016 * r2**3 - 0.0038 * r2**4
    bent = np.stack([u, v], 1) * (1 + radial)[:, None] + brown(u, v, -0.0005, -0.0003)
    bent += r2[:, None] * [0.0019, 0.0032]
    return bent * [852.1, 850.2] + [1440, 1440] - 0.5


def metashape(rays):
    """The manual's fisheye camera; its pixels begin at a corner, and cx, cy in the middle."""
    theta, xy = angles(rays)
    radial = 1 + 0.0412 * theta**2 - 0.0063 * theta**4 + 0.0011 * theta**6
    return xy * radial[:, None] * 1165.3 + [3840 / 2 - 12.4, 2880 / 2 + 8.9] - 0.5


def woodscape(rays):
    """WoodScape's projection.py: 0.5 size + offset - 0.5."""
    theta, xy = angles(rays)
    rho = 340 * theta - 32 * theta**2 + 48 * theta**3 - 7 * theta**4
    unit = np.divide(xy, theta[:, None], out=np.zeros_like(xy), where=theta[:, None] > 0)
    return unit * rho[:, None] + [0.5 * 1280 + 4 - 0.5, 0.5 * 966 - 3 - 0.5]


KB = (190.0, 190.1, 255.0, 257.0, [0.0035, 0.0007, -0.002, 0.0002])
D = [-0.055, 0.229, 0.0046, -0.0011, -0.327]
TRUTH = {
    "agisoft_fisheye.xml": ("metashape", (3840, 2880), metashape),
    "basalt_ds.json": (
        "basalt",
        (512, 512),
        partial(double_sphere, fx=158.0, fy=158.1, cx=255.0, cy=257.0, xi=-0.17, alpha=0.59),
    ),
    "basalt_kb4.json": ("basalt", (512, 512), lambda rays: fisheye(rays, *KB)),
    "cameras.txt": ("colmap", (2880, 2880), thin_prism),
    "camodocal_kannala_brandt.yaml": (
        "camodocal",
        (640, 512),
        lambda rays: fisheye(rays, 300, 300.5, 321, 255, [-0.02, 0.004, -0.001, 0.0002]),
    ),
    "camodocal_mei_kitti360.yaml": ("camodocal", (640, 640), mei),
    "double_sphere_ros_node.yaml": (
        "basalt",
        (1280, 1024),
        partial(double_sphere, fx=321.7, fy=321.4, cx=657.3, cy=530.8, xi=-0.037, alpha=0.618),
    ),
    "kalibr_imucam_chain.yaml": ("kalibr", (512, 512), lambda rays: fisheye(rays, *KB)),
    "opencv_python_dump.json": (
        "opencv",
        (1280, 1024),
        lambda rays: pinhole(rays, 1112.3, 1125.8, 645.9, 536.7, D),
    ),
    "orbslam3_kb8.yaml": ("orbslam", (512, 512), lambda rays: fisheye(rays, *KB)),
    "photonvision.json": (
        "opencv",
        (320, 240),
        lambda rays: pinhole(rays, 350, 349, 163, 120, [0.1, -0.2, 0.001, 0.0002, 0.05]),
    ),
    "stella_openvslam.yaml": ("stella", (512, 512), lambda rays: fisheye(rays, *KB)),
    "woodscape.json": ("woodscape", (1280, 966), woodscape),
}


def read(name: str, **given):
    """A file's lens; the size of the photos is given where the file does not say."""
    size = (1280, 1024) if name == "opencv_python_dump.json" else None
    return read_foreign(FILES / name, image_size=size, **given)


@pytest.mark.parametrize("name", TRUTH)
def test_a_lens_projects_as_its_program_says(name):
    format_name, size, project = TRUTH[name]
    lens, found = read(name)
    assert (found, lens.image_size) == (format_name, size)
    rays = RAYS[:3] if "pinhole" in lens.name else RAYS
    np.testing.assert_allclose(lens.project(rays), project(rays), atol=1e-8, rtol=0)


def test_matlabs_pixels_become_the_rays_of_its_formula():
    """Scaramuzza's model as in MATLAB's pages; its first pixel is (1, 1), and sizes rows first."""
    lens, found = read("matlab_fisheyeIntrinsics.json")
    assert (found, lens.image_size) == ("matlab", (1600, 1200))
    pixel = np.array([[1.0, 1.0], [799.9, 601.3], [1600.0, 30.0]])
    u, v = (pixel - [799.9, 601.3]).T
    rays = np.stack([u, v, 880.0 - 0.0003 * (u * u + v * v)], 1)
    np.testing.assert_allclose(lens.project(rays), pixel - 1, atol=1e-8)


def test_matlabs_stretch_and_nested_cameras(tmp_path):
    one = json.loads((FILES / "matlab_fisheyeIntrinsics.json").read_text())
    one["StretchMatrix"] = [[1.01, 0.02], [-0.003, 1]]
    path = tmp_path / "params.json"
    path.write_text(json.dumps({"Intrinsics": one, "Other": one}))
    lens, _ = read_foreign(path, camera="Intrinsics")
    x, y = np.linalg.solve(one["StretchMatrix"], [300.0, -200.0])
    ray = [x, y, 880.0 - 0.0003 * (x * x + y * y)]
    np.testing.assert_allclose(lens.project(ray), [799.9 + 300 - 1, 601.3 - 200 - 1], atol=1e-8)
    with pytest.raises(CameraFileError, match=r"--camera: Intrinsics, Other$"):
        read_foreign(path)


METASHAPE = (
    "<calibration><projection>{}</projection><width>640</width><height>480</height><f>300</f>"
    "<cx>3</cx><cy>-2</cy><b1>1.5</b1><p1>0.002</p1><p2>-0.001</p2><k1>0.03</k1>{}</calibration>"
)


@pytest.mark.parametrize("projection", ["frame", "equidistant_fisheye"])
def test_metashapes_tangential_and_affine_terms(tmp_path, projection):
    """Its manual: P1 goes with x, B1 and B2 with u."""
    path = tmp_path / "camera.xml"
    b2 = 0.0 if projection == "frame" else -0.8
    path.write_text(METASHAPE.format(projection, f"<b2>{b2}</b2>"))
    x, y = (RAYS[:3, :2] / RAYS[:3, 2:] if projection == "frame" else angles(RAYS)[1]).T
    r2 = x * x + y * y
    more_x = 0.002 * (r2 + 2 * x * x) - 2 * 0.001 * x * y
    more_y = -0.001 * (r2 + 2 * y * y) + 2 * 0.002 * x * y
    x, y = x * (1 + 0.03 * r2) + more_x, y * (1 + 0.03 * r2) + more_y
    u = 320 + 3 + x * 300 + x * 1.5 + y * b2 - 0.5
    lens, _ = read_foreign(path)
    pixel = np.stack([u, 240 - 2 + y * 300 - 0.5], 1)
    np.testing.assert_allclose(lens.project(RAYS[: len(pixel)]), pixel, atol=1e-9)


def test_woodscapes_aspect_ratio_is_that_of_y(tmp_path):
    text = (FILES / "woodscape.json").read_text().replace('ratio": 1.0', 'ratio": 1.1')
    (tmp_path / "FV.json").write_text(text)
    pixel = read_foreign(tmp_path / "FV.json")[0].project(RAYS)
    middle = woodscape(np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(pixel, (woodscape(RAYS) - middle) * [1, 1.1] + middle, atol=1e-9)


def test_a_pinhole_camera_of_each_program(tmp_path):
    numbers = "fx: 400.0\nfy: 401.0\ncx: 320.5\ncy: 239.0\n"
    d = "k1: -0.2\nk2: 0.05\np1: 0.001\np2: -0.0005\n"
    inner = "\n".join(f"  {line}" for line in (numbers + d).splitlines())
    size = "image_width: 640\nimage_height: 480\n"
    files = {
        "camodocal": "model_type: PINHOLE\n" + size + "distortion_parameters:\n"
        + "".join(f"  {line}\n" for line in d.splitlines()) + "projection_parameters:\n"
        + "".join(f"  {line}\n" for line in numbers.splitlines()),
        "stella": f"Camera:\n  setup: mono\n  model: perspective\n{inner}\n  k3: 0.0\n"
        "  cols: 640\n  rows: 480\n",
        "orbslam": "%YAML:1.0\nORBextractor.nLevels: 8\n"
        + "".join(f"Camera.{line}\n" for line in (numbers + d).splitlines()),
    }  # fmt: skip
    for name, text in files.items():
        path = tmp_path / name
        path.write_text(text)
        lens, found = read_foreign(path, image_size=(640, 480))
        assert found == name
        expected = pinhole(RAYS[:3], 400, 401, 320.5, 239, [-0.2, 0.05, 0.001, -0.0005])
        np.testing.assert_allclose(lens.project(RAYS[:3]), expected, atol=1e-9)
    with pytest.raises(CameraFileError, match="an ORB-SLAM PinHole settings file does not say how"):
        read_foreign(tmp_path / "orbslam")


def test_of_several_cameras_one_is_named(tmp_path):
    path = tmp_path / "stereo.yaml"
    text = (FILES / "orbslam3_kb8.yaml").read_text()
    second = "\n".join(re.findall("Camera1.*", text)).replace("Camera1", "Camera2")
    path.write_text(f"{text}\n{second.replace('cx: 255', 'cx: 259')}\n")
    assert read_foreign(path, camera="Camera2")[0].cx == 259
    with pytest.raises(CameraFileError, match=r"--camera: Camera1, Camera2$"):
        read_foreign(path)
    basalt = json.loads((FILES / "basalt_kb4.json").read_text())["value0"]
    other = json.loads((FILES / "basalt_ds.json").read_text())["value0"]
    path.write_text(json.dumps({"value0": {
        "intrinsics": basalt["intrinsics"] + other["intrinsics"],
        "resolution": [[512, 512], [9, 8]],
    }}))  # fmt: skip
    assert read_foreign(path, camera="1")[0].image_size == (9, 8)
    with pytest.raises(CameraFileError, match=r"--camera: 0, 1$"):
        read_foreign(path, camera="")
    for name in ("photonvision.json", "matlab_fisheyeIntrinsics.json"):
        with pytest.raises(CameraFileError, match="holds one camera: leave out --camera"):
            read(name, camera="left")


MEI, DS, ORB = "camodocal_mei_kitti360.yaml", "basalt_ds.json", "orbslam3_kb8.yaml"
STELLA, WOODSCAPE, AGISOFT = "stella_openvslam.yaml", "woodscape.json", "agisoft_fisheye.xml"
MATLAB, DUMP, PHOTON = (
    "matlab_fisheyeIntrinsics.json",
    "opencv_python_dump.json",
    "photonvision.json",
)


def changed(name: str, old: str, new: str) -> tuple[str, str]:
    text = (FILES / name).read_text()
    assert old in text
    return name, text.replace(old, new)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (changed(MEI, "MEI", "SCARAMUZZA"),
         "a camodocal file: model_type 'SCARAMUZZA' is no lens that is known here: known: MEI,"),
        (changed(MEI, "gamma1", "gamma"),
         "a camodocal MEI file: projection_parameters.gamma1 is not there"),
        (changed(MEI, "xi: 1.9", "xi: .nan"),
         "mirror_parameters.xi must hold 1 finite numbers"),
        (changed(MEI, "550.", "-550."), "focal lengths must be above 0"),
        (changed(MEI, "xi: 1.9", "xi: 1.9\n   xi: 2"), "'xi' is there twice"),
        (changed(DS, "158.0", '"158"'), "a basalt ds calibration: value0.intrinsics.0."),
        (changed(DS, '"ds"', '["ds"]'), "camera_type '' is no lens"),
        (changed(DS, '"ds"', '"eucm"'), "camera_type 'eucm' is no lens that is known"),
        (changed(DS, "[[512, 512]]", "[[512, 1e300]]"), "two whole numbers from 1 to"),
        (changed(DS, "0.59", "true"), "intrinsics.alpha must hold 1 finite numbers"),
        (changed(DS, "0.59", "1.59"), "alpha must be from 0 to 0.9999"),
        (changed(ORB, "Camera1", "Camera."), "is not an ORB-SLAM settings file"),
        (changed(STELLA, '"fisheye"', '"equirectangular"'),
         "a stella_vslam file: Camera.model 'equirectangular' is no lens that is known here"),
        (changed(WOODSCAPE, '"k1": 340.0', '"k1": 0'), "this camera was not calibrated"),
        (changed(WOODSCAPE, '"intrinsic"', '"intrinsic.k1": 5, "intrinsic"'), "is there twice"),
        (changed(AGISOFT, "fisheye", "spherical"), "projection 'spherical' is no lens"),
        (changed(AGISOFT, "</k3>", "</k3><p3>0.1</p3>"), "p3 is not 0, and no lens"),
        (changed(AGISOFT, "<f>1165.3</f>", ""), "a Metashape fisheye calibration: f is"),
        (changed(MATLAB, "880.0", "-880.0"), "would look backwards"),
        (changed(MATLAB, "-0.0003, ", ""), "MappingCoefficients must hold 4"),
        (changed(MATLAB, "0.0, 0.0]", "0, 0, 1]"), "must hold 4 finite"),
        (changed(MATLAB, "[1, 0]", "[0, 0]"), "c must be near 1"),
        (changed(DUMP, "left_dist", "other"), "of no format that is known by"),
        (changed(PHOTON, "320.0", "-1"), "resolution.width and resolution.height must"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(tmp_path, file, message):
    name, text = file
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(CameraFileError) as refused:
        read_foreign(path, image_size=(64, 48) if "left" in text else None)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "camera_matrix" not in str(refused.value) or name.startswith("opencv")


def test_deep_nesting_is_no_lens(tmp_path):
    path = tmp_path / "deep.json"
    path.write_text('{"value0": ' * 400 + '{"camera_type": 1}' + "}" * 400)
    with pytest.raises(CameraFileError, match="is not a basalt calibration"):
        camera_keys.read_basalt(path)


FOUR = "%YAML:1.0\nK: [400, 0, 320, 0, 400, 240, 0, 0, 1]\nD: [-0.02, 0.003, -0.0004, 0.00001]\n"


def test_four_coefficients_are_whose_the_user_says(tmp_path):
    path = tmp_path / "camera.yml"
    path.write_text(FOUR)
    core, d = (400.0, 400.0, 320.0, 240.0), [-0.02, 0.003, -0.0004, 0.00001]
    for lens, project in (("fisheye", fisheye), ("pinhole", pinhole)):
        found, _ = read_foreign(path, image_size=(640, 480), lens=lens)
        np.testing.assert_allclose(found.project(RAYS[:3]), project(RAYS[:3], *core, d), atol=1e-9)
    with pytest.raises(CameraFileError, match="say which with --lens fisheye or --lens pinhole"):
        read_foreign(path, image_size=(640, 480))
    path.write_text(FOUR + "model: fisheye\n")
    with pytest.raises(
        CameraFileError, match="says that its lens is a fisheye's: leave out --lens"
    ):
        read_foreign(path, image_size=(640, 480), lens="pinhole")
    assert read_foreign(path, image_size=(640, 480), lens="fisheye")[0].name == "kannala_brandt"
    with pytest.raises(UsageError, match="says which lens it holds: leave out --lens"):
        read("basalt_ds.json", lens="fisheye")
    with pytest.raises(CameraFileError, match="lens 'omni' is not known: fisheye, pinhole"):
        import_camera(path, lens="omni")
    path.write_text(FOUR)
    line = ("import", path, "--size", "640x480", "-o", tmp_path / "camera.yaml", "--max-angle", 20)
    run_cli(*line, "--lens", "fisheye")
    assert load_camera(tmp_path / "camera.yaml").made_by["options"]["lens"] == "kannala_brandt"


@pytest.mark.slow
@pytest.mark.parametrize("name", [*TRUTH, "matlab_fisheyeIntrinsics.json"])
def test_every_file_is_compared_and_straightens_photos(tmp_path, name):
    lens, format_name = read(name)
    camera, photo = tmp_path / "camera.yaml", tmp_path / "photo.png"
    width, height = lens.image_size
    size = ("--size", f"{width}x{height}") if name.startswith("opencv") else ()
    run_cli("import", FILES / name, *size, "-o", camera)
    same = json.loads(run_cli("compare", camera, camera, "--json").stdout)
    assert same["max_px"] < 1e-8
    # One bright spot, where the lens sees a ray of known direction.
    ray = np.array([0.2, -0.1, 1.0])
    spot = lens.project(ray)
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    picture = 255 * np.exp(-((x - spot[0]) ** 2 + (y - spot[1]) ** 2) / 50)
    cv2.imwrite(str(photo), picture.astype(np.uint8))
    view = ("--view", "perspective", "--hfov", "50", "--size", "401x301")
    run_cli("undistort", photo, tmp_path / "flat.png", "-m", camera, *view)
    flat = cv2.imread(str(tmp_path / "flat.png"), cv2.IMREAD_GRAYSCALE).astype(float)
    x, y = np.meshgrid(np.arange(401), np.arange(301))
    found = np.array([(flat * axis).sum() for axis in (x, y)]) / flat.sum()
    focal = 200.5 / np.tan(np.deg2rad(25))
    assert np.abs(found - (ray[:2] * focal + [200, 150])).max() < 0.5
    assert load_camera(camera).camera.image_size == (width, height)
    assert sniffed(FILES / name) == format_name
