"""undistort and map: the right view of the right photos, and nothing replaced unasked."""

import io
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from running import Run
from samples import SAMPLE
from saved_maps import read_map

from cubicfish import load_camera, save_camera
from cubicfish_cli.commands import pictures
from cubicfish_cli.commands.undistort import named_sources

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
    assert sorted(path.name for path in (tmp_path / "out").glob("[!.]*")) == ["a.jpg", "b.jpg"]
    assert picture(tmp_path / "out" / "b.jpg").shape == (72, 96, 3)


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
    assert [path.name for path in out.glob("[!.]*")] == ["b.jpg"]
    said = run(
        "undistort", PHOTO, tmp_path / "new.png", "-m", model, "--mask", out / "b.jpg", code=1
    )
    assert "b.jpg exists already: choose another name or add --overwrite or --skip-e" in said.stderr
    run(*args, "--overwrite")
    assert picture(out / "b.jpg").shape == (72, 96, 3)


def test_the_view_is_the_one_asked_for(run: Run, model: Path, tmp_path: Path) -> None:
    args = ["--hfov", 90, "--size", "101x51", "--rotate", "30,20,90"]
    said = run("map", tmp_path / "m.npz", "-m", model, *args).stdout
    assert said.splitlines()[0] == (
        f"wrote {tmp_path / 'm.npz'}: 101x51 pixels, 90.0° across, focal length 50.50 px"
    )
    written = read_map(tmp_path / "m.npz")
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
    a, b = (read_map(tmp_path / f"{n}.npz").view for n in "ab")
    assert a["size"] == [960, 720]
    assert b["focal"] == pytest.approx(a["focal"] / 2)


@pytest.mark.parametrize(
    ("args", "code", "message"),
    [
        (["undistort", PHOTO, "out.xyz"], 1, "out.xyz"),
        (["undistort", "no.png", "out.png"], 1, "no.png"),
        (
            ["undistort", PHOTO, "out.png", "--hfov", "180"],
            2,
            "--hfov 180 is too wide: a perspective view shows less than 180° across: choose about "
            "120 or less, or --view cylindrical, equirectangular, stereographic or equidistant\n",
        ),
        (
            ["map", "out.npz", "--view", "cylindrical", "--hfov", "9x181"],
            2,
            "--hfov ...x181 is too wide: a cylindrical view shows less than 180° down: choose "
            "--view stereographic or equidistant\n",
        ),
        (
            ["undistort", PHOTO, "out.png", "--view", "equirectangular", "--hfov", "9x360"],
            2,
            "an equirectangular view shows 180° at most down: choose --view equidistant\n",
        ),
        (
            ["undistort", PHOTO, "out.png", "--hfov", "abc"],
            2,
            "--hfov must be a number of degrees above 0, not 'abc'\n",
        ),
        (["undistort", PHOTO, "out.png", "--hfov", "90", "--scale", "9"], 2, "the same thing"),
        (["undistort", PHOTO, "out.png", "--hfov=9x9", "--size=9x9"], 2, "sets how high"),
        (["undistort", PHOTO, "out.png", "--fit", "1.5"], 2, "a share from 0 to 1"),
        (["undistort", PHOTO, "out.png", "--rotate", "1,2,3,4"], 2, "yaw,pitch,roll"),
        (["undistort", PHOTO, "out.png", "--rotate", "nan"], 2, "yaw,pitch,roll"),
        (["undistort", PHOTO, "out.png", "--view", "cube", "--fov", "90"], 2, "leave out --hfov"),
        (["undistort", PHOTO, "out.png", "--view", "cube", "--size", "9x8"], 2, "NxN"),
        (["undistort", PHOTO, "o.png", "--skip-existing", "--overwrite"], 2, "exclude"),
        (["undistort", PHOTO, "o.png", "--fit=inner", "--rotate=180,0,0"], 1, "does not see"),
        (["undistort", PHOTO, "out.png", "--size", "99999x10"], 1, "size"),
        (["undistort", PHOTO], 2, "\nError: Missing argument 'OUT'.\n"),
        (["map"], 2, "\nError: Missing argument 'OUT'.\n"),
        (["map", "out.tif"], 2, "out.tif: maps are written as .npz, .exr, .png, .pgm"),
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
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((73, 96), np.uint8))
    said = run("undistort", tmp_path / "small.png", tmp_path / "o.png", "-m", model, code=1).stderr
    assert "the photo has 96x73 pixels, the camera was calibrated for 960x720" in said
    assert not (tmp_path / "o.png").exists()


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """Three photos, the second of which is damaged."""
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        (folder / name).write_bytes(PHOTO.read_bytes())
    (folder / "b.jpg").write_bytes(PHOTO.read_bytes()[:5000])
    return folder


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_bad_photo_is_named_and_the_rest_done(
    run: Run, model: Path, tmp_path: Path, photos: Path, jobs: int
) -> None:
    out = tmp_path / "out"
    done = run("undistort", photos, out, "-m", model, "--hfov", "90", "-j", jobs, code=1)
    assert sorted(path.name for path in out.glob("[!.]*")) == ["a.jpg", "c.jpg"]
    first, last = done.stderr.splitlines()
    assert first.startswith(f"failed: {photos / 'b.jpg'} is cut short")
    assert last == "Error: 1 of 3 photos could not be undistorted: see above"
    assert done.stdout.startswith(f"wrote 2 pictures to {out}: ")


def test_of_many_failures_ten_are_reported(run: Run, model: Path, tmp_path: Path) -> None:
    photos = tmp_path / "in"
    photos.mkdir()
    for number in range(12):
        (photos / f"{number}.png").touch()
    end = [tmp_path / "out", "-m", model, "--size", "96x72", "--hfov", "90"]
    lines = run("undistort", photos, *end, code=1).stderr.splitlines()
    assert lines[0] == f"failed: {photos / '0.png'} is empty: copy it again or leave it out"
    assert lines[10:] == [
        "and 2 more, which --json lists",
        "Error: 12 of 12 photos could not be undistorted: see above",
    ]


def test_results_that_cannot_be_written_are_refused_before_the_work(
    run: Run, model: Path, tmp_path: Path
) -> None:
    photos = [tmp_path / "a.jpg", tmp_path / "b.jpg"]
    for photo in photos:
        photo.write_bytes(PHOTO.read_bytes())
    (tmp_path / "out").touch()
    end = [tmp_path / "out", "-m", model, "--size", "96x72", "--hfov", "90"]
    error = run("undistort", *photos, *end, code=1).stderr
    assert error.endswith("out is a file, not a folder\n")
    assert error.count("\n") == 1


def test_existing_results_are_skipped_when_asked(
    run: Run, model: Path, tmp_path: Path, photos: Path
) -> None:
    out = tmp_path / "out"
    args = ["undistort", photos, out, "-m", model, "--size", "96x72", "--skip-existing"]
    run(*args, code=1)
    before = {path.name: path.stat().st_mtime_ns for path in out.glob("[!.]*")}
    (photos / "b.jpg").write_bytes(PHOTO.read_bytes())
    said = run(*args)
    assert "skipped 2 photos" in said.stderr
    assert said.stdout.startswith(f"wrote {out / 'b.jpg'}: ")
    after = {path.name: path.stat().st_mtime_ns for path in out.glob("[!.]*")}
    assert {name: after[name] for name in before} == before
    assert len(after) == 3
    assert run(*args).stdout == "nothing to do\n"
    mask = tmp_path / "mask.png"
    assert run(*args, "--mask", mask).stdout == f"nothing to do\nwrote {mask}\n"
    assert run(*args, "--mask", mask).stdout == "nothing to do\n"


def test_pictures_of_two_cameras_or_views_are_not_mixed(
    run: Run, model: Path, tmp_path: Path, photos: Path
) -> None:
    (photos / "b.jpg").unlink()
    out, other = tmp_path / "out", tmp_path / "other.yaml"
    camera = load_camera(model).camera
    save_camera(other, replace(camera, max_angle_deg=camera.max_angle_deg - 5))
    args = ["undistort", photos, out, "--size", "96x72"]
    run(*args, "-m", model)
    (photos / "d.jpg").write_bytes(PHOTO.read_bytes())
    said = run(*args, "-m", other, "--skip-existing", code=1).stderr
    assert "another camera" in said
    assert str(model) in said.replace("\n", "")
    more = ("-m", model, "--skip-existing")
    assert "another view" in run(*args, *more, "--hfov", 50, code=1).stderr
    assert not (out / "d.jpg").exists()
    assert "skipped 2 photos" in run(*args, *more).stderr
    run(*args, "-m", other, "--overwrite")
    assert run(*args, "-m", other, "--skip-existing").stdout == "nothing to do\n"


def test_what_another_run_writes_meanwhile_is_skipped(
    run: Run, model: Path, tmp_path: Path, photos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (photos / "b.jpg").unlink()
    args = ["undistort", photos, tmp_path / "out", "-m", model, "--size", "96x72", "-j", 1]
    plan = pictures.plan_pictures

    def plan_and_be_overtaken(*given: Any, **more: Any) -> Any:
        made = plan(*given, **more)
        monkeypatch.setattr(pictures, "plan_pictures", plan)
        run(*args)
        return made

    monkeypatch.setattr(pictures, "plan_pictures", plan_and_be_overtaken)
    said = run(*args, "--skip-existing")
    assert "skipped 2 photos" in said.stderr
    assert said.stdout == "nothing to do\n"


def test_of_a_cube_that_is_there_in_part_the_rest_is_made(
    run: Run, model: Path, tmp_path: Path
) -> None:
    args = ["undistort", PHOTO, tmp_path / "c.png", "-m", model, "--view", "cube", "--size", "9x9"]
    run(*args)
    made = {path: path.read_bytes() for path in tmp_path.glob("c_*.png")}
    gone, kept = tmp_path / "c_front.png", tmp_path / "c_up.png"
    gone.unlink()
    kept.write_bytes(b"mine")
    assert run(*args, "--skip-existing").stdout.startswith(f"wrote {gone}: ")
    assert {path: path.read_bytes() for path in tmp_path.glob("c_*.png")} == {**made, kept: b"mine"}


@pytest.mark.parametrize("listed", ["{0}\n\n  \n{1}\n\n", "{0}\r\n\r\n{1}", "{0}\0{1}\0"])
def test_names_on_stdin_may_have_blank_lines_or_zeros_between(
    monkeypatch: pytest.MonkeyPatch, listed: str
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(listed.format("a b.jpg", "c.jpg"), newline=""))
    assert named_sources(["first.jpg", "-"]) == ["first.jpg", "a b.jpg", "c.jpg"]


@pytest.mark.parametrize("listed", ["", "\n \n", "\0\0"])
def test_no_names_on_stdin_are_wrong_usage(run: Run, tmp_path: Path, listed: str) -> None:
    said = run("undistort", "-", tmp_path / "out", "-m", "any.yaml", input=listed, code=2).stderr
    assert "stdin lists no photos: give one name a line" in said


def test_names_come_as_arguments_globs_and_from_stdin(
    run: Run, model: Path, tmp_path: Path, photos: Path
) -> None:
    (photos / "b.jpg").unlink()
    a, c = photos / "a.jpg", photos / "c.jpg"
    common = ["-m", model, "--size", "96x72"]
    run("undistort", a, c, tmp_path / "o1", *common)
    run("undistort", str(photos / "*.jpg"), tmp_path / "o2", *common)
    run("undistort", "-", tmp_path / "o3", *common, input=f"{a}\n\n{c}\n")
    for folder in ("o1", "o2", "o3"):
        assert sorted(p.name for p in (tmp_path / folder).glob("[!.]*")) == ["a.jpg", "c.jpg"]
    run("undistort", a, tmp_path / "o1", *common, "--overwrite")
    (tmp_path / "o4").mkdir()
    run("undistort", a, tmp_path / "o4", *common)
    assert [p.name for p in (tmp_path / "o4").glob("[!.]*")] == ["a.jpg"]
    assert "lists no photos" in run("undistort", "-", "o", *common, input="\n", code=2).stderr


def test_a_photo_is_never_replaced_by_its_own_result(run: Run, model: Path, photos: Path) -> None:
    before = (photos / "a.jpg").read_bytes()
    for out in (photos, photos / "a.jpg"):
        said = run("undistort", photos / "a.jpg", out, "-m", model, "--overwrite", code=1).stderr
        assert "is read here, and would be replaced" in said
    assert (photos / "a.jpg").read_bytes() == before


def test_a_view_at_its_limit_says_so(run: Run, model: Path, tmp_path: Path) -> None:
    args = ["-m", model, "--size", "96x72"]
    for fit in ("outer", "whole"):
        out = tmp_path / f"{fit}.png"
        said = run("undistort", PHOTO, out, *args, "--fit", fit).stderr
        assert "sees more than a perspective picture can show" in said
        assert "--fit outer" not in said  # it would show no more
    said = run("undistort", PHOTO, tmp_path / "p.png", *args, "--view", "equidistant").stderr
    assert "can show" not in said


@pytest.mark.slow
def test_what_the_camera_saw_is_told_from_what_the_view_spans(
    run: Run, model: Path, tmp_path: Path
) -> None:
    camera = load_camera(model).camera
    args = ["-m", model, "--view", "equidistant"]
    done = run("undistort", PHOTO, tmp_path / "o.png", *args)
    words = r"the camera sees ([0-9.]+)° of ([0-9.]+)° across, ([0-9.]+)° of [0-9.]+° down: "
    found = re.fullmatch(words + "the rest is empty\n", done.stderr)
    assert found is not None
    seen, across = float(found[1]), float(found[2])
    assert f"equidistant, {across:.1f}° across" in done.stdout
    assert seen == pytest.approx(2 * camera.max_angle_deg, abs=0.5)
    assert seen < across
    assert run("map", tmp_path / "m.npz", *args).stderr == done.stderr
    assert (
        "beyond the picture's edges"
        in run("undistort", PHOTO, tmp_path / "f.png", "-m", model).stderr
    )
    done = run("undistort", PHOTO, tmp_path / "g.png", "-m", model, "--hfov", 90)
    assert done.stderr == ""


def test_a_cube_is_six_pictures(run: Run, model: Path, tmp_path: Path) -> None:
    args = ["undistort", PHOTO, tmp_path / "o.png", "-m", model, "--view", "cube"]
    run(*args, "--size", "40x40", "--mask", tmp_path / "m.png", "--camera", tmp_path / "k")
    faces = ("front", "right", "back", "left", "up", "down")
    for face in faces:
        assert picture(tmp_path / f"o_{face}.png").shape == (40, 40, 3)
        assert picture(tmp_path / f"m_{face}.png").shape == (40, 40)
        assert (tmp_path / f"k_{face}.view.yaml").exists()
    assert picture(tmp_path / "m_front.png").all()
    assert not picture(tmp_path / "m_back.png").any()


def test_rescaled_photos_show_the_same(run: Run, model: Path, tmp_path: Path) -> None:
    photo = cv2.GaussianBlur(picture(PHOTO), (0, 0), 4)  # nothing that halving softens
    cv2.imwrite(str(tmp_path / "whole.png"), photo)
    half = cv2.resize(photo, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(tmp_path / "half.png"), half)
    view = ["-m", model, "--hfov", 60, "--size", "160x120"]
    said = run("undistort", tmp_path / "whole.png", tmp_path / "whole_flat.png", *view).stderr
    assert "photo of the same camera" not in said
    said = run("undistort", tmp_path / "half.png", tmp_path / "half_flat.png", *view).stderr
    assert "half.png has 480x360 pixels, 0.5 times" in said
    assert "(960x720): taken as a reduced photo of the same camera" in said
    whole = picture(tmp_path / "whole_flat.png").astype(float)
    assert np.abs(picture(tmp_path / "half_flat.png") - whole).mean() < 1.2


def test_a_photo_of_another_shape_is_not_said_to_be_a_reduced_one(
    run: Run, model: Path, tmp_path: Path
) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), picture(PHOTO)[:, :700])
    said = run("undistort", tmp_path / "a.png", tmp_path / "b.png", "-m", model, code=1).stderr
    assert "use photos of that size or of exactly that shape" in said
    assert "taken as" not in said


def test_sizes_that_are_not_the_cameras_own_are_said_once_each(
    run: Run, model: Path, tmp_path: Path
) -> None:
    photos = tmp_path / "in"
    photos.mkdir()
    for number, scale in enumerate((1.5, 1.0, 0.5, 1.5)):
        sized = cv2.resize(picture(PHOTO), None, fx=scale, fy=scale)
        cv2.imwrite(str(photos / f"{number}.png"), sized)
    line = ("undistort", photos, tmp_path / "out", "-m", model, "--size", "96x72", "-j", 1)
    said = run(*line).stderr
    assert said.count("photo of the same camera") == 2
    assert "0.png has 1440x1080 pixels, 1.5 times" in said
    assert "taken as an enlarged photo" in said


def test_the_mask_and_the_camera_go_along(run: Run, model: Path, tmp_path: Path) -> None:
    mask, out = tmp_path / "mask.png", tmp_path / "o.png"
    args = ["-m", model, "--hfov", 150, "--rotate", "30,0,0"]
    said = run("undistort", PHOTO, out, *args, "--mask", mask, "--camera", out).stdout
    files = [mask, out.with_suffix(".view.yaml")]
    assert said.splitlines()[1:] == [f"wrote {path}" for path in files]
    trusted = picture(mask)
    assert set(np.unique(trusted)) == {0, 255}
    assert not picture(out)[trusted == 0].any()
    record = yaml.safe_load(files[1].read_text())
    matrix = np.array(record["K"])
    assert record["kind"] == "perspective"
    assert record["image_size"] == [960, 720]
    np.testing.assert_allclose(record["camera_from_view"], [0, np.radians(30), 0], atol=1e-12)
    assert 2 * np.degrees(np.arctan(480 / matrix[0, 0])) == pytest.approx(150)


@pytest.mark.slow
def test_one_small_photo_needs_no_scipy(model: Path, tmp_path: Path) -> None:
    code = (
        "import sys\nfrom cubicfish_cli.terminal.main import cli\n"
        f"cli(['undistort', {str(PHOTO)!r}, {str(tmp_path / 'o.png')!r}, '-m', {str(model)!r}], "
        "standalone_mode=False)\n"
        "print(sorted({'scipy', 'rich', 'av', 'OpenEXR'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.slow
def test_an_interrupt_leaves_whole_files_only(model: Path, tmp_path: Path) -> None:
    photos, out = tmp_path / "in", tmp_path / "out"
    photos.mkdir()
    for number in range(60):
        (photos / f"{number}.jpg").write_bytes(PHOTO.read_bytes())
    args = ["undistort", str(photos), str(out), "-m", str(model), "-j", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "cubicfish_cli", *args],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        end = time.monotonic() + 30
        while not (out.exists() and list(out.glob("*.jpg"))) and time.monotonic() < end:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 130
    assert said == "Interrupted.\n"
    left = {path.name for path in out.iterdir()} - {".undistorted.json"}
    assert 0 < len(left) < 60
    for name in left:
        assert picture(out / name).shape == (720, 960, 3)
        assert not name.startswith(".")


def write_video(path: Path) -> None:
    """Five frames of the sample's photo."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 960, 720, "yuv420p"
        colour = cv2.cvtColor(picture(PHOTO), cv2.COLOR_BGR2RGB)
        for _ in range(5):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(colour, format="rgb24")))
        container.mux(stream.encode(None))


@pytest.mark.slow
def test_a_video_becomes_a_video(run: Run, model: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "in.mp4")
    args = ["undistort", tmp_path / "in.mp4", tmp_path / "out.mp4", "-m", model, "--crf", "10"]
    said = run(*args).stdout
    assert said.startswith(f"wrote {tmp_path / 'out.mp4'}: 960x720 pixels, 120.0° across")
    ok, frame = cv2.VideoCapture(str(tmp_path / "out.mp4")).read()
    assert ok
    run("undistort", PHOTO, tmp_path / "flat.png", "-m", model)
    difference = frame[..., 1].astype(int) - picture(tmp_path / "flat.png")[..., 1]
    assert np.abs(difference).mean() < 6  # what the encoder loses, of noise above all
    assert "exists already" in run(*args, code=1).stderr
    assert run(*args, "--skip-existing").stdout == "nothing to do\n"


def test_a_video_needs_the_name_of_one_or_a_folder(run: Run, model: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4")
    args = ["undistort", tmp_path / "a.mp4", "-m", model, "--size", "96x72"]
    said = run(*args, tmp_path / "flat.png", code=2).stderr
    assert "flat.png is no video: name a video such as " in said
    assert not (tmp_path / "flat.png").exists()
    file = tmp_path / "frames" / "a.mp4"
    assert run(*args, tmp_path / "frames").stdout.startswith(f"wrote {file}: 96x72 pixels")
    assert file.is_file()


def test_a_bad_video_is_named_and_the_rest_done(run: Run, model: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4")
    (tmp_path / "b.mp4").write_bytes(b"nothing")
    args = ["-m", model, "--size", "96x72"]
    done = run("undistort", str(tmp_path / "*.mp4"), tmp_path / "out", *args, code=1)
    end = "Error: 1 of 2 videos could not be undistorted: see above"
    assert done.stderr.splitlines()[-1] == end
    assert [path.name for path in (tmp_path / "out").glob("[!.]*")] == ["a.mp4"]
    cube = ["--view", "cube"]
    said = run("undistort", tmp_path / "a.mp4", "o.mp4", "-m", model, *cube, code=2).stderr
    assert "choose another for videos" in said
    said = run("undistort", tmp_path / "a.mp4", PHOTO, tmp_path / "out", *args, code=2).stderr
    assert "photos and videos together" in said
