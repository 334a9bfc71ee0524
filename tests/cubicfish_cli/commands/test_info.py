"""What a camera is, in the terminal, in its file, and wherever a camera is used by default."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from running import Run
from samples import SAMPLE
from synthetic_lenses import synthetic_lens

from cubicfish import CubicCamera, build_view, load_camera
from cubicfish.judge import FitRecord
from cubicfish.judge.camera_facts import field_seen
from cubicfish.views import ViewOptions, choose_view
from cubicfish.views.fields import lost_shares
from cubicfish_cli import save_camera
from cubicfish_cli.commands.info import CameraInfo
from cubicfish_cli.undistortion.remarks import view_remarks

TRUTH = synthetic_lens("equisolid")


def facts(run: Run, *args: object) -> dict[str, object]:
    found = json.loads(run("info", *args, "--json").stdout)
    assert isinstance(found, dict)
    return found


def test_the_figures_are_those_of_the_lens(run: Run, calibrated: Path) -> None:
    found = facts(run, calibrated)
    assert found["focal_px"] == pytest.approx(TRUTH.focal, rel=2e-3)
    # The true lens leans and is decentred: its axis is not quite where its formula begins.
    assert found["principal_point"] == pytest.approx(TRUTH.centre, abs=5)
    sigma = np.array([found["focal_sigma_px"], found["principal_point_sigma_px"]], float)
    assert (sigma > 0).all()
    assert (sigma < 0.5).all()
    assert found["verdict"]["level"] == "care"  # type: ignore[index] - nothing was held out


def test_a_smaller_field_is_seen_where_the_camera_is_trusted_less(calibrated: Path) -> None:
    camera = load_camera(calibrated / "camera.yaml").camera
    narrow = CubicCamera(
        image_size=camera.image_size, P=camera.P, max_angle_deg=40.0, radial=camera.radial
    )
    whole, seen = field_seen(camera), field_seen(narrow)
    assert whole.horizontal > whole.vertical > 120
    assert seen.horizontal == pytest.approx(80, abs=1)
    assert seen.diagonal == pytest.approx(80, abs=1)
    assert whole.horizontal < 2 * camera.max_angle_deg + 1e-6


@pytest.mark.parametrize("share", [0.7, 0.5])
def test_what_a_lens_shows_does_not_depend_on_where_the_board_was(
    calibrated: Path, share: float
) -> None:
    """Of a photo's middle rows, where the truth is inside 90° from the axis."""
    camera = load_camera(calibrated / "camera.yaml").camera
    shift = np.array([[1.0, 0, 0], [0, 1, -160], [0, 0, 1]])
    cut = replace(
        camera,
        image_size=(960, 400),
        P=shift @ camera.P,
        radial=replace(camera.radial, cy=camera.radial.cy - 160, image_size=(960, 400)),
    )
    whole, seen = field_seen(cut), field_seen(replace(cut, max_angle_deg=share * whole_deg(cut)))
    assert whole.off_deg[1] == 0
    assert abs(seen.vertical - whole.vertical) <= 3 * seen.off_deg[1] < 12
    # To the sides the photo may be black, or not.
    assert seen.horizontal == pytest.approx(2 * share * whole_deg(cut), abs=1)
    assert str(seen).startswith(f"at least {seen.horizontal:.0f}° x {seen.vertical:.0f}°")


def whole_deg(camera: CubicCamera) -> float:
    """Half of what a photo shows from its top to its bottom, degrees."""
    return field_seen(camera).vertical / 2


def test_a_photo_shows_its_edges_also_where_the_camera_is_not_calibrated(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    camera = load_camera(calibrated / "camera.yaml").camera
    shift = np.array([[1.0, 0, -280], [0, 1, -210], [0, 0, 1]])
    radial = replace(
        camera.radial, cx=camera.radial.cx - 280, cy=camera.radial.cy - 210, image_size=(400, 300)
    )
    middle = CubicCamera(
        image_size=(400, 300), P=shift @ camera.P, max_angle_deg=20.0, radial=radial
    )
    seen = field_seen(middle)
    spans = np.rad2deg(400 / np.mean(TRUTH.focal))
    assert seen.horizontal == pytest.approx(spans, abs=4)
    assert seen.horizontal > seen.vertical > 60
    save_camera(tmp_path / "camera.yaml", middle)
    assert "calibrated to 20° from the axis" in run("info", tmp_path).stdout
    uncalibrated, cut_off = lost_shares(middle, build_view(middle))
    # The cone is a circle of 89 pixels in the photo.
    assert uncalibrated == pytest.approx(1 - np.pi * 89**2 / (400 * 300), abs=0.03)
    assert cut_off < 0.05
    cv2.imwrite(str(tmp_path / "p.png"), np.full((300, 400), 200, np.uint8))
    line = ("undistort", tmp_path / "p.png", tmp_path / "f.png", "-m", tmp_path)
    assert "% of the photo is left out" in run(*line).stderr
    turned = ViewOptions(rotate_deg=(5, 0, 0))
    for given, reported in (
        (ViewOptions(), True),
        (ViewOptions(hfov_deg=30), False),
        (turned, False),
    ):
        remarks = " ".join(view_remarks(choose_view(camera, given)))
        assert ("lies beyond the picture's edges" in remarks) == reported


@pytest.mark.parametrize(
    ("change", "says", "of_camera"),
    [
        (lambda record: record.update(image_size=[480, 360]), "reaches beyond the photo", True),
        (lambda record: record.update(image_size=[1920, 1440]), "the grid of fit.", True),
        (lambda record: record["fit"].update(uncertainty=3), "fit.uncertainty must hold", True),
        (lambda record: record["fit"]["uncertainty"].update(focal_px=[-1, 0.1]), "below 0", False),
        (lambda record: record["fit"]["uncertainty"]["sigma_px"][0].append(-1), "below 0", False),
    ],
)
def test_figures_that_contradict_each_other_are_refused(
    run: Run,
    calibrated: Path,
    tmp_path: Path,
    change: Callable[[Any], None],
    says: str,
    of_camera: bool,
) -> None:
    """What takes the camera alone does not look at figures that say nothing of it."""
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    change(record)
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(record))
    assert says in run("info", tmp_path, code=1).stderr
    alone = run("unproject", "-m", tmp_path, "100,100", code=int(of_camera))
    assert (says in alone.stderr) == of_camera


def test_a_file_without_a_fit_says_what_it_knows(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    del record["fit"], record["made_by"]
    bare = tmp_path / "bare.yaml"
    bare.write_text(yaml.safe_dump(record))
    said = run("info", bare).stdout
    assert "focal length" in said
    assert "verdict" not in said
    assert "±" not in said
    assert facts(run, bare)["rms_px"] is None


def test_a_damaged_record_is_no_traceback(calibrated: Path) -> None:
    loaded = load_camera(calibrated / "camera.yaml")
    fit = {"rms_px": "small", "uncertainty": {"focal_px": [1, "x"]}, "images": None}
    known = replace(loaded, fit=FitRecord.of(fit), made_by={"title": 3, "target": "x"})
    found = CameraInfo(model=calibrated, known=known).as_record()
    assert (found["focal_sigma_px"], found["title"], found["target"]) == (None, None, None)
    assert found["rms_px"] is None


@pytest.mark.usefixtures("quick_fit")
def test_the_title_and_the_line_are_in_the_file_and_in_the_output(run: Run, tmp_path: Path) -> None:
    table, target = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
    line = ("calibrate", table, "-t", target, "--no-hold-out", "-o", tmp_path / "c")
    said = run(*line, "--title", "front left").stdout
    lens = said.splitlines()[1]
    assert re.match(
        r"front left: 960x720 px, sees at least \d+° x \d+° \(at least \d+° diagonal\), "
        r"calibrated to \d+° from the axis, focal length ",
        lens,
    )
    first, second = (tmp_path / "c" / "camera.yaml").read_text().splitlines()[:2]
    assert re.fullmatch(
        re.escape(f"# {lens}, ") + r"error 0\.\d+ px RMS, uncertainty ±0\.\d+ px, usable with care",
        first,
    )
    assert second == "cubicfish: 1"
    assert run("info", tmp_path / "c").stdout.splitlines()[0] == first[2:]
    error = run(*line, "--title", "two\nlines", "--overwrite", code=2).stderr
    assert "--title must be a line of plain text" in error


@pytest.mark.slow
def test_every_command_takes_a_folder_and_names_its_own_choice(
    run: Run, calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo = SAMPLE / "photos" / "corner_01.jpg"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "calibration").symlink_to(calibrated)
    lines = [
        ("undistort", photo, "flat.png"),
        ("map", "m.npz"),
        ("export", "--to", "opencv", "-o", "c.yaml", "--max-error", "5"),
        ("project", "0,0,1"),
        ("unproject", "480,360"),
        ("info",),
    ]
    for line in lines:
        assert "Camera: calibration/camera.yaml.\n" in run(*line).stderr
        assert "Camera:" not in run(*line, "-q", *over(line)).stderr
        assert "Camera:" not in run(*line, "-m", calibrated, *over(line)).stderr
    refused = run("undistort", photo, "other.png", "--crf", "20", code=2).stderr
    assert "--crf goes with videos" in refused
    assert "Camera:" not in refused
    monkeypatch.setenv("CUBICFISH_MODEL", str(calibrated))
    assert f"Camera: {calibrated}/camera.yaml.\n" in run("info").stderr
    run("compare", calibrated, calibrated / "camera.yaml")
    error = run("info", tmp_path, code=1).stderr
    assert "is a folder without a camera.yaml" in error


def over(line: tuple[object, ...]) -> tuple[str, ...]:
    return ("--overwrite",) if line[0] in ("undistort", "map", "export") else ()
