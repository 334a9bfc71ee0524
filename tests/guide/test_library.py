"""The package as a library: loaded late, typed, silent, and the same as the command line."""

import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from shutil import copy
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from lenses import smaller
from listening import Heard
from running import run_cli
from samples import SAMPLE
from saved_maps import read_map
from synthetic import checkerboard

import cubicfish
import cubicfish_cli
from cubicfish import (
    CameraFileError,
    CorrespondenceError,
    DetectionError,
    FitError,
    OutputError,
    TargetError,
    UsageError,
    ViewError,
)
from cubicfish.judge import FitRecord
from cubicfish_cli import (
    Calibration,
    CameraFile,
    CubicfishError,
    Event,
    LookOptions,
    Observations,
    Run,
    SimulateOptions,
    Target,
    UndistortOptions,
    build_map,
    build_plane,
    build_view,
    calibrate,
    compare,
    detect,
    evaluate,
    export_camera,
    import_camera,
    load_camera,
    load_corners,
    read_picture,
    save_camera,
    save_corners,
    save_map,
    save_target,
    simulate_files,
    undistort,
    undistort_files,
)

# The last bits of a matrix product depend on where in memory its arrays happen to be.
P_BITS = 1e-7
PHOTOS = [SAMPLE / "photos" / f"corner_0{number}.jpg" for number in (1, 4)]
HEAVY = {"numpy", "cv2", "scipy", "yaml", "click", "rich", "matplotlib"}


@pytest.fixture(scope="module")
def target() -> Target:
    return Target.load(SAMPLE / "target.yaml")


@pytest.fixture(scope="module")
def corners(target: Target) -> Observations:
    return load_corners(SAMPLE / "true_corners.csv", target)


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.ascontiguousarray(read_picture(PHOTOS[0])[..., 1])  # grey


def as_arrays(corners: Observations, target: Target) -> tuple[list[np.ndarray], list[np.ndarray]]:
    photos = range(len(corners.images))
    world = target.world_points(corners.board, corners.column, corners.row)
    return [world[corners.image == photo] for photo in photos], [
        corners.pixel[corners.image == photo] for photo in photos
    ]


# What is loaded, and when.


def heavy_after(code: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split()) & HEAVY


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "loaded"),
    [
        ("import cubicfish_cli as c; dir(c); c.__all__; c.__version__", set()),
        ("import cubicfish as c; dir(c); c.__all__; c.__version__; import cubicfish.views", set()),
        ("from cubicfish_cli import CubicfishError", set()),
        ("from cubicfish_cli import CubicCamera", {"numpy"}),
        ("from cubicfish_cli import Target, load_camera, load_corners", {"numpy", "yaml"}),
        ("from cubicfish_cli import calibrate", {"numpy", "yaml"}),
    ],
)
def test_a_name_loads_what_it_needs_when_it_is_asked_for(code: str, loaded: set[str]) -> None:
    assert heavy_after(code) == loaded


def test_every_name_is_there_and_no_other() -> None:
    assert sorted(cubicfish_cli.__all__) == cubicfish_cli.__all__
    assert {*cubicfish_cli.__all__} <= {*dir(cubicfish_cli)}
    for name in cubicfish_cli.__all__:
        assert getattr(cubicfish_cli, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        cubicfish_cli.calibrat  # noqa: B018
    with pytest.raises(ImportError):
        exec("from cubicfish_cli import calibrat", {})


@pytest.mark.parametrize("package", [cubicfish, cubicfish_cli])
def test_what_mypy_reads_is_what_is_loaded(package: ModuleType) -> None:
    stub = Path(str(package.__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec(stub, names)
    del names["__builtins__"], names["__doc__"], names["__annotations__"]
    assert sorted(names) == sorted(package.__all__)
    for name, value in names.items():
        offered = getattr(package, name)
        assert value in (offered, getattr(offered, "__wrapped__", None))


# What is said of each name.


def public_functions() -> dict[str, Callable[..., Any]]:
    """The functions, and the methods that the classes themselves define, by name."""
    found = {}
    for name in cubicfish_cli.__all__:
        thing = getattr(cubicfish_cli, name)
        if inspect.isfunction(thing):
            found[name] = thing
            continue
        for method, value in vars(thing).items():
            value = getattr(value, "__func__", value)
            if not method.startswith("_") and inspect.isfunction(value):
                found[f"{name}.{method}"] = value
    return found


FUNCTIONS = public_functions()
ARRAYS = re.compile(r"NDArray|ArrayLike|FloatArray|IntArray|Picture|Image\b|UndistortMap")
SHAPE = re.compile(r"\((\.\.\.|N|M|H|h|count|\d)?,")


def test_every_name_has_words_of_its_own() -> None:
    for name in cubicfish_cli.__all__:
        words = getattr(cubicfish_cli, name).__doc__ or ""
        assert len(words) > 30, name
        assert not words.startswith(f"{name}("), name  # what a dataclass says of itself


def test_every_function_says_shapes_units_and_types() -> None:
    for name, function in FUNCTIONS.items():
        words = function.__doc__ or ""
        assert words, f"{name} has no docstring"
        parameters = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
        assert set(parameters) <= set(function.__annotations__), name
        assert "return" in function.__annotations__, name
        if ARRAYS.search(" ".join(map(str, function.__annotations__.values()))):
            assert SHAPE.search(words), f"{name} says no shape"
            said = re.search(r"pixel|unit|radians|index|0 to 1|ray|bit", words)
            assert said, f"{name} says no units"


# The same as the command line.


@pytest.mark.slow
def test_a_camera_is_that_of_the_command_line(
    calibrated: Path, corners: Observations, target: Target
) -> None:
    calibration = calibrate(corners, target, hold_out=False)
    loaded = load_camera(calibrated / "camera.yaml")
    np.testing.assert_allclose(calibration.camera.P, loaded.camera.P, atol=P_BITS)
    assert compare(calibration.camera, loaded.camera).statistics.max_px < 1e-6
    assert calibration.camera.max_angle_deg == pytest.approx(loaded.camera.max_angle_deg)
    assert calibration.verdict == loaded.verdict
    made = build_map(calibration.camera, build_view(calibration.camera))
    of_file = read_map(calibrated / "undistort_map.npz")
    np.testing.assert_allclose(made.map_x, of_file.map_x, atol=1e-3)


@pytest.mark.slow
def test_arrays_give_the_camera_that_named_corners_give(
    fitted: Calibration, corners: Observations, target: Target
) -> None:
    world, pixel = as_arrays(corners, target)
    pairs = Observations.from_points(world, pixel, (960, 720))
    calibration = calibrate(pairs, hold_out=False)
    np.testing.assert_allclose(calibration.camera.P, fitted.camera.P, atol=P_BITS)
    np.testing.assert_allclose(calibration.poses.translation, fitted.poses.translation, atol=1e-5)
    evaluation = evaluate(calibration.camera, pairs)
    assert evaluation.errors.rms_px == pytest.approx(fitted.errors.rms_px, rel=1e-3)
    named = evaluate(calibration.camera, corners, target)
    np.testing.assert_allclose(named.residual, evaluation.residual, atol=1e-7)
    assert compare(calibration.camera, fitted.camera).statistics.max_px < 1e-6


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda camera: camera.project([[1, 2]]), "the shape is (1, 2), where (..., 3) is wanted"),
        (lambda camera: camera.unproject([1, 2, 3]), "the shape is (3,), where (..., 2)"),
        (lambda camera: camera.unproject("x"), "numbers are wanted"),
    ],
)
def test_wrong_arguments_end_in_one_line(
    calibrated: Path, ask: Callable[[Any], object], says: str
) -> None:
    with pytest.raises(ViewError) as refused:
        ask(load_camera(calibrated).camera)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_size_far_beyond_the_corners_is_refused(corners: Observations, target: Target) -> None:
    with pytest.raises(FitError, match="correct the image size"):
        calibrate(replace(corners, image_size=(9600, 7200)), target)


@pytest.mark.slow
def test_pairs_have_a_held_out_error_whatever_is_asked_of_their_target(
    corners: Observations, target: Target
) -> None:
    world, pixel = as_arrays(corners, target)
    pairs = Observations.from_points(world, pixel, (960, 720))
    assert calibrate(pairs, refine_target="points").fit.held_out_rms_px < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("distance", [1e4, 1e7])
def test_a_world_counted_from_far_away_gives_the_same_camera(
    fitted: Calibration, corners: Observations, target: Target, distance: float
) -> None:
    origin = distance * np.array([1, 2, -0.5])
    world, pixel = (arrays[:3] for arrays in as_arrays(corners, target))
    near = calibrate(Observations.from_points(world, pixel, (960, 720)), hold_out=False)
    moved = Observations.from_points([w + origin for w in world], pixel, (960, 720))
    far = calibrate(moved, hold_out=False)
    assert compare(near.camera, far.camera).statistics.max_px < 1e-5
    np.testing.assert_allclose(far.pairs.world, moved.world)
    seen = far.camera.project(far.poses.apply(far.pairs.image, far.pairs.world), near=True)
    np.testing.assert_allclose(seen - far.pairs.pixel, far.residual, atol=1e-5)
    evaluation = evaluate(fitted.camera, moved)
    assert evaluation.errors.rms_px < 0.03
    seen = fitted.camera.project(evaluation.poses.apply(moved.image, moved.world), near=True)
    np.testing.assert_allclose(seen - moved.pixel, evaluation.residual, atol=1e-5)


@pytest.mark.slow
def test_photos_in_memory_give_the_corners_of_their_files(tmp_path: Path, target: Target) -> None:
    run_cli(
        "detect", *PHOTOS, "--target", SAMPLE / "target.yaml", "-o", tmp_path / "corners.csv",
        "--jobs", 1,
    )  # fmt: skip
    of_files = load_corners(tmp_path / "corners.csv", target)
    heard = Heard()
    colours = [np.asfortranarray(read_picture(path)) for path in PHOTOS]
    detection = detect(
        dict(zip([path.name for path in PHOTOS], colours, strict=True)),
        target,
        Run(jobs=1, listener=heard),
    )
    assert heard.events[0] == (Event.LOOKING, {"photos": 2})
    assert heard.of("Finding corners") == [(0, 0), (1, 2), (2, 2)]
    assert heard.of("Looking again") == [(0, 0), (1, 1)]  # one of them lacks corners
    assert detection.corners.images == of_files.images
    for field in ("image", "board", "column", "row"):
        np.testing.assert_array_equal(
            getattr(detection.corners, field), getattr(of_files, field), err_msg=field
        )
    np.testing.assert_allclose(detection.corners.pixel, of_files.pixel, atol=2e-3)
    assert [photo.corners for photo in detection.photos] == [145, 130]
    # The corners as they are found go straight into the fit, with what detection knows.
    calibration = calibrate(detection, target, hold_out=False, listener=heard)
    assert calibration.errors.rms_px < 0.1
    step, share, total, now = heard.steps[-1]
    assert (step, total, bool(now)) == ("Fitting", 1, True)
    assert 0.3 < share <= 1


def test_what_a_photo_was_placed_by_says_nothing_of_the_object(
    monkeypatch: pytest.MonkeyPatch, corners: Observations, target: Target, fitted: Calibration
) -> None:
    from cubicfish import Detection, Finding
    from cubicfish.find import PhotoReport
    from cubicfish.fit import calibrate as fitting

    calls: list[dict[str, Any]] = []
    monkeypatch.setattr(fitting, "calibrate", lambda pairs, **given: calls.append(given) or fitted)
    finding: Finding = object()  # type: ignore[assignment]
    for exact in (True, False):
        report = PhotoReport(name="a", exact=exact)
        calibrate(Detection(corners=corners, photos=(report,), findings=(finding,)), target)
    calibrate(Detection(corners=corners, photos=(report,)), target, refine_target="shape")
    assert [given["refine_target"] for given in calls] == ["auto", "auto", "shape"]
    assert calls[0]["diagnose"].keywords == {"known": [finding]}
    assert calls[0]["target"] is target


def test_a_picture_is_that_of_the_command_line(calibrated: Path, tmp_path: Path) -> None:
    model = calibrated / "camera.yaml"
    run_cli(
        "undistort", PHOTOS[0], tmp_path / "flat.png", "-m", model, "--view", "cylindrical",
        "--hfov", "170", "--size", "300x200", "--rotate=-20,10,5", "--interpolation", "cubic",
    )  # fmt: skip
    camera = load_camera(model).camera
    view = build_view(
        camera, "cylindrical", hfov_deg=170, size=(300, 200), rotate_deg=np.array([-20, 10, 5])
    )
    flat = undistort(read_picture(PHOTOS[0]), camera, view, interpolation="cubic")
    of_file = read_picture(tmp_path / "flat.png").astype(int)
    np.testing.assert_allclose(flat, of_file, atol=1)
    assert np.mean(flat != of_file) < 1e-3
    by_map = undistort(read_picture(PHOTOS[0]), build_map(camera, view), interpolation="cubic")
    np.testing.assert_allclose(by_map.astype(int), flat, atol=1)


# Nothing is said, nothing is written unasked.


@pytest.mark.slow
def test_nothing_is_printed_or_written(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    target: Target,
    picture: np.ndarray,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CUBICFISH_CACHE", str(tmp_path / "cache"))
    calibration = calibrate(detect(PHOTOS[0], target), target, hold_out=False)
    camera = calibration.camera
    evaluate(camera, calibration.pairs)
    assert str(calibration.verdict)
    calibration.uncertainty(camera.project(camera.unproject([[480, 360]])))
    undistort(picture, camera, build_view(camera, "equidistant"))
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


def test_a_fit_and_its_file_give_the_same_answers(tmp_path: Path, fitted: Calibration) -> None:
    path = tmp_path / "camera.yaml"
    fitted.save(path, made_by={"title": "left"})
    loaded = Calibration.load(path)
    assert loaded.verdict == fitted.verdict
    pixel = [[480, 360], [5, 5]]
    np.testing.assert_allclose(loaded.uncertainty(pixel), fitted.uncertainty(pixel))
    assert loaded.title == "left"
    assert str(loaded) == f"left: {fitted}"
    assert "array" not in repr(fitted)
    assert repr(fitted).startswith("<Calibration: 960x720 px, sees ")
    with pytest.raises(OutputError, match="exists"):
        loaded.save(path)
    loaded.save(path, overwrite=True)
    assert Calibration.load(path).made_by == loaded.made_by


def test_a_notebook_shows_words_that_are_no_tags(fitted: Calibration) -> None:
    named = replace(fitted, made_by={"title": "<b>left"})
    assert "&lt;b&gt;left: " in named._repr_html_()
    assert "<br>usable with care: " in named._repr_html_()


def test_a_camera_without_a_fit_has_figures_and_no_verdict(fitted: Calibration) -> None:
    alone = CameraFile(camera=fitted.camera, fit=FitRecord(), made_by={})
    assert str(alone) == alone.line
    assert not alone.is_measured


def test_corners_bring_their_target(
    corners: Observations, target: Target, fitted: Calibration
) -> None:
    assert corners.target is target
    error = evaluate(fitted.camera, corners).errors
    assert error == evaluate(fitted.camera, corners, target).errors
    nameless = replace(corners, target=None, world=np.full_like(corners.world, np.nan))
    assert "need the target" in refusal(
        CorrespondenceError, lambda: evaluate(fitted.camera, nameless)
    )


def test_a_board_is_squared_up_at_a_scale(fitted: Calibration, target: Target) -> None:
    pose = fitted.poses.rotation[0], fitted.poses.translation[0]
    plane = build_plane(fitted.camera, target, "floor", *pose, pixels_per_unit=2, margin=0)
    board = target.boards[target.board_names.index("floor")]
    sides = np.array([board.columns - 1, board.rows - 1]) * board.square
    assert plane.size == tuple((2 * sides).round().astype(int).tolist())
    # Each corner of the board is where the scale says, and the photo has it there.
    pairs = fitted.pairs
    own = (pairs.image == 0) & (pairs.board == target.board_names.index("floor"))
    at = np.column_stack([pairs.column[own], pairs.row[own]]) * board.square * 2 - 0.5
    seen = fitted.camera.project(plane.rays(at), near=True)
    assert np.abs(seen - pairs.pixel[own] - fitted.residual[own]).max() < 1e-5


def test_planes_that_are_none_are_refused(fitted: Calibration, target: Target) -> None:
    rotation, translation = fitted.poses.rotation[0], fitted.poses.translation[0]

    def said(board: str, *pose: Any) -> str:
        return refusal(ViewError, lambda: build_plane(fitted.camera, target, board, *pose))

    assert "'flor' is not in the target: did you mean 'floor'" in refusal(
        TargetError, lambda: build_plane(fitted.camera, target, "flor", rotation, translation)
    )
    vector = cv2.Rodrigues(rotation)[0].ravel()
    by_vector = build_plane(fitted.camera, target, "floor", vector, translation)
    by_matrix = build_plane(fitted.camera, target, "floor", rotation, translation)
    np.testing.assert_allclose(by_vector.origin, by_matrix.origin)
    assert "no rotation matrix" in said("floor", 2 * rotation, translation)
    assert "no rotation matrix" in said("floor", rotation[:2], translation)
    assert "not finite" in said("floor", rotation * np.nan, translation)
    assert "translation has the shape" in said("floor", rotation, translation[:2])
    assert "mirrored" in said("floor", rotation @ np.diag([1, -1, -1]), translation)


@pytest.mark.slow
def test_a_camera_becomes_another_tools_file_as_export_writes_it(
    fitted: Calibration, tmp_path: Path
) -> None:
    fitted.save(tmp_path / "camera.yaml")
    run_cli("export", tmp_path, "--to", "mrcal", "-o", tmp_path / "a.cameramodel")
    made = export_camera(load_camera(tmp_path / "camera.yaml"), "mrcal")
    assert made.text == (tmp_path / "a.cameramodel").read_text(encoding="utf-8")
    assert len(made.note) > 1
    assert all(f"# {line}" in made.text for line in made.note)
    assert export_camera(fitted, "mrcal").conversion.error.max_px == made.conversion.error.max_px
    refused = refusal(FitError, lambda: export_camera(fitted, "mrcl"))
    assert refused == "no format is called 'mrcl': did you mean 'mrcal'?"
    assert "more than the 1e-09 px" in refusal(
        FitError, lambda: export_camera(fitted, "opencv", max_error=1e-9)
    )


FOREIGN = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [300.0, 0.0, 320.5, 0.0, 300.0, 239.0, 0.0, 0.0, 1.0]}
distortion_model: equidistant
distortion_coefficients: {rows: 1, cols: 4, data: [-0.01, 0.0, 0.0, 0.0]}
"""


def test_another_tools_file_becomes_a_camera(tmp_path: Path) -> None:
    path = tmp_path / "info.yaml"
    path.write_text(FOREIGN)
    made = import_camera(path, max_angle_deg=50)
    assert (made.written_by, made.lens.name, made.conversion.ended_by) == (
        "ros",
        "kannala_brandt",
        "angle",
    )
    assert made.camera.max_angle_deg == 50
    assert made.made_by["options"] == {"imported_from": "ros", "lens": "kannala_brandt"}
    assert "conversion" in made.made_by
    # The lens is that of the file, by its formula.
    theta = np.deg2rad(40.0)
    pixel = made.camera.project([np.sin(theta), 0, np.cos(theta)])
    np.testing.assert_allclose(pixel, [320.5 + 300 * (theta - 0.01 * theta**3), 239], atol=0.01)
    own = tmp_path / "own.yaml"
    made.save(own)
    np.testing.assert_array_equal(load_camera(own).camera.P, made.camera.P)
    assert "exists already" in refusal(OutputError, lambda: save_camera(own, made))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"written_by": "roos"}, "did you mean 'ros'?"),
        ({"written_by": "kalibr"}, "info.yaml"),
        ({"camera": "cam1"}, "holds one camera"),
        ({"image_size": (640, 0)}, "image_size must be two whole numbers from 1 to 100000"),
        ({"image_size": (480, 640)}, "is for photos of 640x480 pixels"),
        ({"max_angle_deg": 0}, "max_angle_deg must be above 0 and at most 175, not 0"),
        ({"max_angle_deg": float("nan")}, "not nan"),
    ],
)
def test_what_cannot_be_imported_is_refused(
    tmp_path: Path, options: dict[str, Any], said: str
) -> None:
    path = tmp_path / "info.yaml"
    path.write_text(FOREIGN)
    assert said in refusal(CubicfishError, lambda: import_camera(path, **options))


@pytest.fixture(scope="module")
def board() -> Target:
    """One board of few squares: poses and pictures of it are quickly made."""
    return Target(units="mm", boards=(checkerboard("board", 5, 4, 40.0),))


@pytest.mark.slow
def test_photos_are_the_same_of_a_fit_a_camera_and_its_file(
    fitted: Calibration, board: Target, tmp_path: Path
) -> None:
    target = board
    # The grid of the uncertainty is that of the whole photo.
    known = replace(fitted.fit, uncertainty=FitRecord().uncertainty)
    fitted = replace(fitted, camera=smaller(fitted.camera, 3), fit=known)
    fitted.save(tmp_path / "camera.yaml")
    heard = Heard()
    look = LookOptions(noise=4, blur=1, vignetting=0.2, exposure=0.5, seed=5)
    for lens in (fitted, fitted.camera, tmp_path / "camera.yaml"):
        folder = tmp_path / type(lens).__name__
        run = Run(listener=heard)
        made = simulate_files(
            SimulateOptions(
                target=target, camera=lens, folder=folder, number=1, form="png", look=look
            ),
            run=run,
        )
        files = [*made.photos, *made.truth.values()]
        assert [file.name for file in files] == [
            "photo_01.png",
            "true_corners.csv",
            "true_poses.csv",
            "true_camera.yaml",
        ]
        for file in files[:3]:
            first = tmp_path / type(fitted).__name__ / file.name
            assert file.read_bytes() == first.read_bytes()
        true = load_camera(files[3]).camera
        np.testing.assert_array_equal(true.P, load_camera(tmp_path / "camera.yaml").camera.P)
        assert made.corners == len(load_corners(files[1], target).pixel) >= 10
    assert heard.of("Rendering") == [(0, 0), (1, 1)] * 3
    size = {"width": 320, "height": 240}
    assert heard.events == [(Event.RENDERING, {"pictures": "1 photo", **size})] * 3
    before, dark = files[0].read_bytes(), read_picture(files[0]).mean()
    poses = Path(copy(files[2], tmp_path / "poses.csv"))
    again = {"poses": poses, "form": "png", "look": LookOptions(noise=0)}
    assert "exists already" in refusal(
        OutputError,
        lambda: simulate_files(
            SimulateOptions(target=target, camera=fitted, folder=folder, **again)
        ),
    )
    assert files[0].read_bytes() == before
    simulate_files(
        SimulateOptions(target=target, camera=fitted, folder=folder, **again),
        run=Run(overwrite=True),
    )
    assert files[0].read_bytes() != before
    assert read_picture(files[0]).mean() > 1.5 * dark


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"number": 0}, "number must be from 1 to 10000, not 0"),
        ({"form": "jpeg"}, "photos are not written as 'jpeg': did you mean 'jpg'?"),
        ({"poses": "none.csv"}, "none.csv"),
        ({"poses": "none.csv", "number": 3}, "leave --number out"),
        ({"camera": "no_lens.yaml"}, "no_lens.yaml"),
    ],
)
def test_what_cannot_be_simulated_is_refused(
    fitted: Calibration, target: Target, tmp_path: Path, options: dict[str, Any], said: str
) -> None:
    options: dict[str, Any] = {"camera": fitted.camera, "folder": tmp_path / "a", **options}
    assert said in refusal(
        CubicfishError, lambda: simulate_files(SimulateOptions(target=target, **options))
    )
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"noise": -1}, "noise must be from 0 to 100"),
        ({"blur": float("nan")}, "blur must be from 0 to 50, not nan"),
        ({"vignetting": 1}, "vignetting must be from 0 to 0.8"),
        ({"exposure": 0}, "exposure must be from 0.02 to 4"),
    ],
)
def test_looks_out_of_bounds_are_refused(options: dict[str, Any], said: str) -> None:
    assert said in refusal(UsageError, lambda: LookOptions(**options))


def test_files_are_undistorted_as_the_command_does(fitted: Calibration, tmp_path: Path) -> None:
    fitted.save(tmp_path / "camera.yaml")
    photos = tmp_path / "photos"
    photos.mkdir()
    for photo in PHOTOS:
        (photos / photo.name).write_bytes(photo.read_bytes())
    (photos / "broken.png").write_bytes(b"no picture")
    view = build_view(fitted.camera, "cylindrical", hfov_deg=270, size=(300, 200))
    line = ("--view", "cylindrical", "--hfov", 270, "--size", "300x200")
    run_cli("undistort", photos, tmp_path / "a", "-m", tmp_path, *line, code=1)
    heard = Heard()
    folder = tmp_path / "b"
    options = UndistortOptions(photos=photos, output=folder, camera=fitted, view=view)
    made = undistort_files(options, run=Run(jobs=1, listener=heard))
    assert made.files == tuple(folder / photo.name for photo in PHOTOS)
    assert list(made.failed) == ["broken.png"]
    assert heard.of("Undistorting")[-1] == (3, 3)
    for file in made.files:
        assert file.read_bytes() == (tmp_path / "a" / file.name).read_bytes()
    # Nothing is replaced unasked.
    written = made.files[0].read_bytes()
    again = UndistortOptions(photos=PHOTOS, output=folder, camera=fitted.camera)
    assert "exists already" in refusal(OutputError, lambda: undistort_files(again))
    skipping = replace(again, skip_existing=True)
    assert undistort_files(skipping).skipped == tuple(p.name for p in PHOTOS)
    assert made.files[0].read_bytes() == written
    own = undistort_files(again, run=Run(overwrite=True)).files[0]
    flat = undistort(read_picture(PHOTOS[0]), fitted.camera)
    assert np.abs(read_picture(own).astype(int) - flat).mean() < 3  # JPEG
    assert "is read here, and would be replaced" in refusal(
        OutputError,
        lambda: undistort_files(replace(options, output=photos), run=Run(overwrite=True)),
    )


@pytest.mark.parametrize(
    ("photos", "options", "said"),
    [
        ("none", {}, "none"),
        (["a.mp4", "b.jpg"], {}, "photos and videos together"),
        (PHOTOS, {"crf": 20}, "--crf goes with videos"),
    ],
)
def test_files_that_cannot_be_undistorted_are_refused(
    fitted: Calibration, tmp_path: Path, photos: Any, options: dict[str, Any], said: str
) -> None:
    folder = tmp_path / "flat"
    options = UndistortOptions(photos=photos, output=folder, camera=fitted, **options)
    assert said in refusal(CubicfishError, lambda: undistort_files(options))
    assert not folder.exists()


def test_nothing_is_both_left_and_replaced(fitted: Calibration, tmp_path: Path) -> None:
    folder = tmp_path / "flat"
    options = UndistortOptions(photos=PHOTOS, output=folder, camera=fitted, skip_existing=True)
    assert "exclude each other" in refusal(
        UsageError,
        lambda: undistort_files(options, run=Run(overwrite=True)),
    )
    assert not folder.exists()


def test_a_video_is_undistorted_into_a_folder(tmp_path: Path) -> None:
    pytest.importorskip("av")
    from filming import write_film

    (tmp_path / "info.yaml").write_text(FOREIGN)
    lens = import_camera(tmp_path / "info.yaml")
    film = write_film(tmp_path / "film.mp4", [np.full((480, 640), 99, np.uint8)])
    made = undistort_files(UndistortOptions(photos=film, output=tmp_path / "flat", camera=lens))
    assert made.files == (tmp_path / "flat" / "film.mp4",)
    assert made.files[0].stat().st_size > 1000


def test_the_program_offers_the_names_of_the_library() -> None:
    both = {*cubicfish.__all__} & {*cubicfish_cli.__all__}
    assert {"Target", "calibrate", "load_camera", "CubicfishError"} < both
    for name in both:
        assert getattr(cubicfish, name) is getattr(cubicfish_cli, name)


def test_files_are_those_of_the_command_line(
    tmp_path: Path, fitted: Calibration, corners: Observations, target: Target
) -> None:
    camera = tmp_path / "made" / "camera.yaml"
    save_camera(str(camera), fitted, made_by={"station": ("a", 3)})
    save_corners(tmp_path / "corners.csv", corners)
    save_target(tmp_path / "target.yaml", target)
    save_map(tmp_path / "map.npz", build_map(fitted.camera, build_view(fitted.camera)))
    loaded = load_camera(str(camera))
    np.testing.assert_array_equal(loaded.camera.P, fitted.camera.P)
    assert loaded.made_by == {"version": cubicfish_cli.__version__, "station": ["a", 3]}
    assert loaded.verdict == fitted.verdict
    np.testing.assert_allclose(
        loaded.uncertainty([[480, 360], [5, 5]]), fitted.uncertainty([[480, 360], [5, 5]])
    )
    np.testing.assert_array_equal(Target.load(tmp_path / "target.yaml").corners()[3],
                                  target.corners()[3])  # fmt: skip
    again = run_cli("evaluate", tmp_path / "corners.csv", "-t", tmp_path / "target.yaml",
                    "-m", camera)  # fmt: skip
    assert "10 photos" in again.output
    with pytest.raises(OutputError, match="exists already"):
        save_camera(camera, loaded)
    save_camera(camera, loaded, overwrite=True)
    assert load_camera(camera).made_by == loaded.made_by
    save_camera(camera, fitted.camera, overwrite=True)
    assert load_camera(camera).fit.says_nothing
    assert load_camera(camera).verdict.level == "care"


# What cannot be is refused in one line.


def refusal(error: type[CubicfishError], call: Callable[[], object]) -> str:
    with pytest.raises(error) as caught:
        call()
    said = str(caught.value)
    assert "\n" not in said
    assert isinstance(caught.value, CubicfishError)
    return said


def test_corners_that_cannot_be_fitted_to_are_refused(
    corners: Observations, target: Target, fitted: Calibration
) -> None:
    pairs = fitted.pairs
    nameless = replace(pairs, boards=(), board=np.full(len(pairs.board), -1))
    other = Target(units="mm", boards=target.boards[:2])

    def said(given: Any, of: Target | None = None, **more: Any) -> str:
        return refusal(CorrespondenceError, lambda: calibrate(given, of, **more))

    unknown_world = np.full_like(corners.world, np.nan)
    assert "need the target" in said(replace(corners, target=None, world=unknown_world))
    with pytest.raises(UsageError, match=r"^corners must be an Observations .* not a list"):
        calibrate([1, 2])
    assert "do not say which corners" in said(nameless, target)
    assert "board 'right' is not in the target" in said(pairs, other)
    assert "board 'right' is not in the target" in said(corners, other)
    assert "pixel, row 0 is not finite" in said(replace(pairs, pixel=pairs.pixel * np.nan))
    assert "world has the shape" in said(replace(pairs, world=pairs.world[:, :2]))
    assert "world has 7 rows" in said(replace(pairs, world=pairs.world[:7]))
    assert "weight has the shape" in said(replace(pairs, weight=pairs.weight[:7]))
    assert "image must not decrease" in said(replace(pairs, image=pairs.image[::-1]))
    assert "image must hold" in said(replace(pairs, image=pairs.image + 0.5))
    assert "image must count from 0" in said(replace(pairs, image=pairs.image + 1))
    assert "board must count from 0" in said(replace(corners, board=corners.board - 1), target)
    assert "column must count from 0" in said(replace(corners, column=corners.column - 1), target)
    assert "image_size must be" in said(replace(pairs, image_size=(960,)))
    unknown: Any = "shapes"
    assert "did you mean 'shape'" in refusal(
        UsageError, lambda: calibrate(corners, target, refine_target=unknown)
    )
    few = Observations.from_points([pairs.world[:9]], [pairs.pixel[:9]], (960, 720))
    assert "9 points in 1 photo are too few" in refusal(FitError, lambda: calibrate(few))
    middle = Observations.from_points([pairs.world[:99]], [np.zeros((99, 2))], (1, 1))
    assert "enough corners to be placed" in refusal(FitError, lambda: calibrate(middle))
    small = Observations.from_points([pairs.world[:9]], [pairs.pixel[:9] / 10], (96, 72))
    assert "photos of 96x72" in refusal(FitError, lambda: evaluate(fitted.camera, small))


@pytest.mark.parametrize(
    ("photos", "said"),
    [
        ([], "no photo was given"),
        ({}, "no photo was given"),
        ([np.zeros((4, 4))], "photo_0 holds float64 numbers"),
        ([np.zeros((4, 4), bool)], "photo_0 holds bool numbers"),
        ([np.zeros((4, 4, 5), np.uint8)], "photo_0 has the shape (4, 4, 5)"),
        (np.zeros((4, 4), np.uint8), "photo_0 has the shape (4,), not (H, W) or (H, W, 1 to 4)"),
        ([np.zeros((0, 4), np.uint8)], "photo_0 has 4x0 pixels"),
        ([np.zeros((4, 4), np.uint8), "a.png"], "photo_1 is no array but str"),
        ({"a\nb": np.zeros((4, 4), np.uint8)}, "must be printable text"),
        ([np.zeros((40, 40), np.uint8)], "1 photo, no checkerboard"),
    ],
)
def test_pictures_that_are_none_are_refused(photos: Any, said: str, target: Target) -> None:
    assert said in refusal(DetectionError, lambda: detect(photos, target))


def test_pictures_of_other_kinds_are_undistorted_alike(
    picture: np.ndarray, fitted: Calibration
) -> None:
    camera = fitted.camera
    made = build_map(camera, build_view(camera, size=(64, 48)))
    grey = undistort(picture, made)
    for shape in ((), (1,), (2,), (3,), (4,)):
        given = np.broadcast_to(picture.reshape(720, 960, *(1 for _ in shape)), (720, 960, *shape))
        out = undistort(given, made)
        assert out.shape == (48, 64, *shape)
        # OpenCV blends one channel by other instructions than several.
        np.testing.assert_allclose(out.reshape(48, 64, -1)[..., 0].astype(int), grey, atol=2)
    for kind in (np.uint16, np.float32):
        assert undistort(picture.astype(kind), made).dtype == kind
    half = undistort(picture[::2, ::2], camera)  # an exact rescale of the calibrated size
    assert half.shape == (360, 480)
    assert half.mean() == pytest.approx(undistort(picture, camera).mean(), rel=0.1)
    outside = undistort(picture, camera, build_view(camera, "equidistant"))
    assert outside[0, 0] == 0


def test_pictures_and_views_that_cannot_be_are_refused(
    picture: np.ndarray, fitted: Calibration
) -> None:
    camera = fitted.camera
    view = build_view(camera)
    made = build_map(camera, view)

    def said(*given: Any, **more: Any) -> str:
        return refusal(ViewError, lambda: undistort(*given, **more))

    assert "has the shape (720,)" in said(picture[:, 0], camera)
    assert "has the shape (720, 960, 5)" in said(np.dstack([picture] * 5), camera)
    assert "holds float64 numbers" in said(picture.astype(float), camera)
    assert "960x0 pixels" in said(picture[:0], camera)
    assert "calibrated for 960x720" in said(picture[:-1], camera)
    assert "the map is for 960x720" in said(picture[::2, ::2], made)
    assert "a map has its view already" in said(picture, made, view)
    for odd, must in (("photo.png", "an array"), (None, "an array")):
        with pytest.raises(UsageError, match=f"^picture must be {must}, not "):
            undistort(odd, camera)
    with pytest.raises(UsageError, match=r"^by must be .*, not 'known': load_camera\(path\)"):
        undistort(picture, "known")
    with pytest.raises(UsageError, match=r"^interpolation must be .*did you mean 'linear'"):
        undistort(picture, camera, interpolation="linaer")

    def no_view(*given: Any, **more: Any) -> str:
        return refusal(UsageError, lambda: build_view(camera, *given, **more))

    assert "did you mean 'cylindrical'" in no_view("cylinder")
    assert "kind must be 'perspective'" in no_view(3)
    assert "not 'cube'" in no_view("cube")
    assert "hfov_deg and focal say the same thing twice" in no_view(hfov_deg=90, focal=300)
    assert "sets how high the picture is" in no_view(hfov_deg=90, vfov_deg=60, size=(9, 9))
    for share in ("middle", "0.5", 1.5, float("nan"), (0.5,)):
        assert "fit must be 'inner'" in no_view(fit=share)
    assert "rotate_deg must be yaw,pitch,roll" in no_view(rotate_deg=(1, 2))
    for angles in (5, "123", (0, 0, float("nan"))):
        assert "rotate_deg" in no_view(rotate_deg=angles)
    for field in (0, -5, float("inf")):
        assert "hfov_deg must be a number of degrees above 0" in no_view(hfov_deg=field)
    for field in ("90", float("nan")):
        assert "hfov_deg must be a number or None" in no_view(hfov_deg=field)
    assert "hfov_deg 270 is too wide: a perspective view shows less than 180" in no_view(
        hfov_deg=270
    )
    assert "focal must be a number of pixels" in no_view(focal=-3)
    assert "size must be WIDTHxHEIGHT" in no_view(size=())
    for size in ((9.5, 9), 9, "99"):
        assert "whole number" in no_view(size=size)
    assert "1 to 32766 pixels" in refusal(ViewError, lambda: build_view(camera, size=(0, 9)))


def test_numbers_of_numpy_are_as_good_as_pythons(fitted: Calibration) -> None:
    camera = fitted.camera
    plain = build_view(camera, size=(90, 60), hfov_deg=90, rotate_deg=(5, 0, 0))
    given = build_view(
        camera, size=np.array([90, 60]), hfov_deg=np.float32(90), rotate_deg=np.array([5, 0, 0])
    )
    assert plain == given
    inner, outer = (build_view(camera, "equidistant", fit=end) for end in ("inner", "outer"))
    assert inner == build_view(camera, "equidistant", fit=0)
    assert inner.focal > 1.2 * outer.focal
    assert build_view(camera, hfov_deg=90, vfov_deg=90).size == (960, 960)


def test_uncertainty_is_known_in_the_field_alone(fitted: Calibration) -> None:
    pixel = np.array([[[480, 360], [300, 200]], [[-3, 360], [np.nan, 5]]])
    sigma = fitted.uncertainty(pixel)
    assert sigma.shape == (2, 2)
    assert (sigma[0] > 0).all()
    assert np.isnan(sigma[1]).all()
    assert fitted.uncertainty([480, 360]) == sigma[0, 0]
    narrow = replace(fitted.camera, max_angle_deg=20.0)
    assert np.isnan(replace(fitted, camera=narrow).uncertainty([[480, 100]])).all()
    silent = CameraFile(camera=fitted.camera, fit=FitRecord(), made_by={})
    odd = replace(
        silent, fit=FitRecord.of({"uncertainty": {"x": [1, 2], "y": "a", "sigma_px": []}})
    )
    for file in (silent, odd):
        assert "does not say" in refusal(CameraFileError, lambda f=file: f.uncertainty([[1, 1]]))
    assert "not (..., 2)" in refusal(CorrespondenceError, lambda: fitted.uncertainty([1, 2, 3]))


@pytest.mark.parametrize("value", [np.zeros(3), float("nan"), {"a": {"b": object()}}])
def test_only_plain_data_are_saved(tmp_path: Path, fitted: Calibration, value: Any) -> None:
    path = tmp_path / "camera.yaml"
    said = refusal(CameraFileError, lambda: save_camera(path, fitted, made_by={"a": value}))
    assert said.startswith("made_by may hold")
    assert not path.exists()
    odd: Any = fitted.camera.radial
    with pytest.raises(UsageError, match=r"^camera must be .*, not a RadialCamera"):
        save_camera(path, odd)


@pytest.mark.parametrize("text", ["a\x1b[31m", "a\nb: 1", "\0", "\u2028", "é", "# a"])
@pytest.mark.parametrize("key", ["title", "else"])
def test_what_is_saved_is_read_again(
    tmp_path: Path, fitted: Calibration, key: str, text: str
) -> None:
    path = tmp_path / "camera.yaml"
    save_camera(path, fitted.camera, made_by={key: text})
    assert load_camera(path).made_by[key] == text
    assert path.read_text(encoding="utf-8").splitlines()[0].isprintable()


@pytest.mark.parametrize("value", ["\ud800", 10**400, [[[[[[[[[[[[[[1]]]]]]]]]]]]]]])
def test_what_could_not_be_read_again_is_not_saved(
    tmp_path: Path, fitted: Calibration, value: Any
) -> None:
    path = tmp_path / "camera.yaml"
    said = refusal(CameraFileError, lambda: save_camera(path, fitted, made_by={"a": value}))
    assert said.startswith("made_by may hold")
    assert said.isprintable()
    assert not path.exists()


# Threads.


@pytest.mark.slow
def test_threads_do_not_disturb_each_other(
    corners: Observations, target: Target, picture: np.ndarray, fitted: Calibration
) -> None:
    world, pixel = as_arrays(corners, target)
    views = [build_view(fitted.camera, hfov_deg=angle) for angle in (60, 120)]

    def work(number: int) -> tuple[np.ndarray, ...]:
        own = slice(number, number + 2)
        pairs = Observations.from_points(world[own], pixel[own], (960, 720))
        flat = undistort(picture, fitted.camera, views[number])
        rays = fitted.camera.unproject(pixel[number])
        return calibrate(pairs, hold_out=False).camera.P, flat, rays

    alone = [work(number) for number in range(2)]
    with ThreadPoolExecutor(4) as threads:
        together = list(threads.map(work, [0, 1, 0, 1]))
    for one, other in zip(alone * 2, together, strict=True):
        for a, b, bits in zip(one, other, (P_BITS, 1, 1e-9), strict=True):
            np.testing.assert_allclose(a.astype(float), b, atol=bits)
