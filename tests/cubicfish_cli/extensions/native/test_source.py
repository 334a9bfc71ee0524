"""Cameras in other languages: each answers as the camera does, wherever it looks."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from decentred_mirror import DecentredMirror
from languages import LANGUAGES, Answers, Questions, ask
from lenses import cubic_camera, random_rays
from running import Run

from cubicfish import Calibration, CameraFile, CubicCamera
from cubicfish.fit.nearest_cubic import linear_ratios
from cubicfish.models.lift import lift, sphere_basis, sphere_null_space

COUNT = 5_000  # that are inside, of twice as many
# Whatever its owner calls it, its source compiles.
TITLE = "left */ `${x}` \u00fc\n#error\\"
# Those that are started or compiled in less than half a second.
QUICK = ("gcc", "python", "node")


def ill_conditioned(camera: CubicCamera) -> CubicCamera:
    """The same camera with large cubics in P that vanish on the sphere, as fits may leave some."""
    more = np.random.default_rng(0).standard_normal((3, 4)) @ sphere_null_space().T
    P = camera.P + 100 * np.linalg.norm(camera.P, axis=1)[:, None] * more
    return replace(camera, P=P / np.linalg.norm(P))


def mirror_camera() -> CubicCamera:
    """A cubic near a mirror that is not centred: its rays are those that leave the mirror."""
    lens, scale = DecentredMirror(shift_mm=(0.6, -0.3), tilt_deg=(0.8, 0.5)), 350.0
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-340, 340, 60)]), axis=-1).reshape(-1, 2)
    away, centre = grid[np.hypot(*grid.T) < 340], (np.array(lens.image_size) - 1) / 2
    _, rays = lens.rays(away + centre)
    basis = sphere_basis()
    coefficients = linear_ratios(lift(rays) @ basis, away / scale, denominator_pull=1e-3)
    P = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]]) @ coefficients
    return replace(
        cubic_camera(),
        image_size=lens.image_size,
        P=P @ basis.T,
        max_angle_deg=float(np.rad2deg(np.arccos(rays[:, 2].min()))),
    )


@pytest.fixture(scope="module")
def cameras(fitted: Calibration) -> dict[str, CameraFile]:
    made = {
        "sample": fitted.camera,
        "wide": cubic_camera(),
        "past180": cubic_camera(115.0, bend=0.002),
        "narrow": ill_conditioned(cubic_camera(40.0, bend=0.002)),
        "mirror": mirror_camera(),
        "near": replace(cubic_camera(98.0), pupil_travel=3.5, units="mm"),
    }
    made_by = {"date": "2026-01-01T00:00:00", "title": TITLE}
    return {name: CameraFile(camera=camera, made_by=made_by) for name, camera in made.items()}


@pytest.fixture(scope="module")
def asked(cameras: dict[str, CameraFile]) -> dict[str, Questions]:
    """Rays of the field and beyond it, points near the lens, pixels of the photo and around it."""
    made = {}
    for name, known in cameras.items():
        rng, (width, height) = np.random.default_rng(0), known.camera.image_size
        rays = random_rays(min(known.camera.max_angle_deg + 15, 180), 2 * COUNT)
        pixel = known.camera.project(rays)
        around = rng.uniform(
            (-0.2 * width, -0.2 * height), (1.2 * width, 1.2 * height), pixel.shape
        )
        pixel = np.where(np.isfinite(pixel), pixel, around)
        numbers = np.hstack([rays, rays * rng.uniform(30, 3000, (len(rays), 1)), pixel])
        numbers = numbers.astype(np.float32).astype(float)  # that all languages have
        made[name] = Questions(rays=numbers[:, :3], points=numbers[:, 3:6], pixel=numbers[:, 6:])
    return made


@pytest.fixture(scope="module")
def answers(
    cameras: dict[str, CameraFile],
    asked: dict[str, Questions],
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str], dict[str, Answers]]:
    known: dict[str, dict[str, Answers]] = {}

    def of(language: str) -> dict[str, Answers]:
        if shutil.which(LANGUAGES[language].program) is None:
            pytest.skip(f"there is no {language}")
        if language not in known:
            known[language] = ask(language, cameras, asked, tmp_path_factory.mktemp("language"))
        return known[language]

    return of


@pytest.mark.parametrize("name", ["sample", "wide", "past180", "narrow", "mirror", "near"])
@pytest.mark.parametrize(
    "language",
    [one if one in QUICK else pytest.param(one, marks=pytest.mark.slow) for one in LANGUAGES],
)
def test_a_camera_answers_the_same_in_every_language(
    language: str,
    name: str,
    cameras: dict[str, CameraFile],
    asked: dict[str, Questions],
    answers: Callable[[str], dict[str, Answers]],
) -> None:
    camera, given, found = cameras[name].camera, asked[name], answers(language)[name]
    near_px, near_rad = LANGUAGES[language].near_px, LANGUAGES[language].near_rad
    of_points, slopes = camera.project_jacobian(given.points, near=True)
    of_pixel = camera.unproject(given.pixel)
    for expected in (of_points, of_pixel):
        assert COUNT < np.isfinite(expected[:, 0]).sum() < 2 * COUNT
    np.testing.assert_allclose(found.of_rays, camera.project(given.rays), rtol=0, atol=near_px)
    np.testing.assert_allclose(found.of_points, of_points, rtol=0, atol=near_px)
    np.testing.assert_allclose(found.of_pixel, of_pixel, rtol=0, atol=near_rad)
    if found.slopes is not None:
        np.testing.assert_allclose(found.slopes, slopes, rtol=1e-8, atol=1e-9)


def test_the_file_says_whose_camera_it_is(
    run: Run, calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = yaml.safe_load((calibrated / "camera.yaml").read_text())
    text["made_by"]["title"] = TITLE
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(text))
    for to, suffix in (
        ("c", "h"),
        ("python", "py"),
        ("js", "mjs"),
        ("glsl", "glsl"),
        ("osl", "osl"),
    ):
        run("export", "own.yaml", "--to", to, "--name", "left")
        header = Path(f"left.{suffix}").read_text().splitlines()[:4]
        assert {line.partition(" ")[0] for line in header} == {"#" if to == "python" else "//"}
        assert "SPDX-License-Identifier: MIT" in header[0]
        assert "960x720 pixels, calibrated 20" in header[1]
        assert f"Field: {text['max_angle_deg']:.3f} degrees" in header[2]
        assert "Held-out error: not known." in header[2]
    shader = Path("left.glsl").read_text().partition("forward.\n")[2]
    assert shader in Path("left.mjs").read_text()


@pytest.mark.parametrize("name", ["", "2nd", "a-b", "a__b", "gl_lens", "a_", "a" * 61, "camera\n"])
def test_a_name_that_is_no_identifier_is_refused(
    name: str, run: Run, calibrated: Path, tmp_path: Path
) -> None:
    said = run("export", calibrated, "--to", "c", "--name", name, "-o", tmp_path / "c.h", code=2)
    assert "functions begin with it" in said.stderr
    assert not (tmp_path / "c.h").exists()


def test_formats_of_lenses_have_no_functions_to_name(run: Run, calibrated: Path) -> None:
    for to in ("opencv", "maps"):
        assert "--name" in run("export", calibrated, "--to", to, "--name", "a", code=2).stderr
