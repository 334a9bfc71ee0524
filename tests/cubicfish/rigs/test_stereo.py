"""Pairs of cameras: rows of their pictures agree, and disparities are distances."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from simulated import CornerErrors
from simulated_rig import RigTruth, corner_target, simulated_rig
from synthetic import TRUE_LENS
from synthetic_lenses import SyntheticLens, synthetic_lens

from cubicfish import Rig, ViewError, build_map, build_view, calibrate_rig, rectify
from cubicfish.geometry import camera_centre
from cubicfish.rigs.stereo import ROW_ALIGNED, RectifiedPair, rectified_pair
from cubicfish.scene.truth import Pose, rotation_matrix
from cubicfish.views import CentralView

PLACE: Pose = (np.array([0.02, 0.1, -0.03]), np.array([-120.0, 4.0, 6.0]))
VIEWS = {
    "perspective": CentralView(kind="perspective", size=(801, 601), focal=220.0),
    "epipolar-cylindrical": CentralView(kind="epipolar-cylindrical", size=(801, 901), focal=220.0),
    "epipolar-equirectangular": CentralView(
        kind="epipolar-equirectangular", size=(701, 901), focal=220.0
    ),
}


def wide_lens(field_deg: float) -> SyntheticLens:
    lens = synthetic_lens("equisolid", (960, 720))
    focal = 0.49 * 720 / (2 * np.sin(np.deg2rad(field_deg) / 4))
    return replace(lens, focal=(focal, 0.999 * focal), max_angle_deg=field_deg / 2)


@cache
def calibrated() -> tuple[Rig, RigTruth]:
    """A pair calibrated from corners with 0.1 px of noise, through lenses of no fitted family."""
    target = corner_target()
    corners, truth = simulated_rig(
        [wide_lens(200), wide_lens(190)],
        [(np.zeros(3), np.zeros(3)), PLACE],
        target,
        15,
        distances=(50, 300),
        middle=(330, 330, 300),
        errors=CornerErrors(noise=0.1, shared=0, spread=0),
    )
    cameras = dict(zip(("left", "right"), corners, strict=True))
    return calibrate_rig(cameras, target, refine_target="off"), truth


def pair_of(rig: Rig) -> RectifiedPair:
    return rectify(rig, "left", "right")


def shown(
    pair: RectifiedPair, view, pixels: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where both pictures show what the photos show at pixels, and which of them do."""
    places = [
        own.pixels(camera.unproject(pixel))
        for camera, own, pixel in zip(pair.cameras, pair.views(view), pixels, strict=True)
    ]
    inside = np.ones(len(pixels[0]), bool)
    with np.errstate(invalid="ignore"):
        for place in places:
            inside &= ((place >= 0) & (place <= np.array(view.size) - 1)).all(axis=1)
    return places[0], places[1], inside


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROW_ALIGNED)
def test_rows_of_a_calibrated_pair_agree_within_a_tenth_of_a_pixel(kind: str) -> None:
    rig, truth = calibrated()
    pair, view = pair_of(rig), VIEWS[kind]
    rng = np.random.default_rng(3)
    way = rng.standard_normal((40_000, 3))
    points = way / np.linalg.norm(way, axis=1, keepdims=True) * rng.uniform(300, 5000, (40_000, 1))
    pixels = [
        own.lens.project(points @ rotation_matrix(place[0]).T + place[1])
        for own, place in zip(truth.cameras, truth.camera_from_rig, strict=True)
    ]
    first, second, inside = shown(pair, view, pixels)
    # Up to where corners were: beyond, the cameras are a guess of their own.
    for one, place in zip(rig.cameras, truth.camera_from_rig, strict=True):
        own = points @ rotation_matrix(place[0]).T + place[1]
        cosine = own[:, 2] / np.linalg.norm(own, axis=1)
        inside &= cosine > np.cos(np.deg2rad(float(one.fit.covered_deg)))
    assert inside.sum() > 5000
    # A row of half-planes about a line is stretched towards that line's ends, without bounds.
    rays = points @ pair.rotations[0].T
    stretch = np.linalg.norm(rays, axis=1) / np.hypot(rays[:, 1], rays[:, 2])
    rows = (first - second)[:, 1]
    assert np.sqrt(np.mean(rows[inside & (stretch < 2)] ** 2)) < 0.1
    assert np.sqrt(np.mean((rows / stretch)[inside] ** 2)) < 0.1
    if kind != "perspective":  # beyond 180 degrees about the line between the cameras
        assert points[inside, 2].min() < 0


@pytest.mark.slow
def test_pictures_of_a_flat_scene_match_row_by_row() -> None:
    """What cv2.remap makes of rendered photos, not what the cameras say of points."""
    rig, truth = calibrated()
    pair = pair_of(rig)
    view = CentralView(
        kind="epipolar-cylindrical", size=(525, 901), focal=220.0
    )  # to 50 degrees on either side
    pictures = []
    for number, (camera, own) in enumerate(zip(pair.cameras, pair.views(view), strict=True)):
        lens, place = truth.cameras[number].lens, truth.camera_from_rig[number]
        width, height = lens.image_size
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
        rays = lens.unproject(grid)
        covered = np.cos(np.deg2rad(float(rig.cameras[number].fit.covered_deg)))
        rays[~(rays[..., 2] > covered)] = np.nan
        # Far away, stripes along half-planes that end in the line between the cameras.
        _, y, z = np.moveaxis(rays @ rotation_matrix(place[0]) @ pair.rotations[0].T, -1, 0)
        photo = (127.5 + 127.5 * np.sin(40 * np.arctan2(y, z))).astype(np.float32)
        made = build_map(camera, own)
        out = cv2.remap(photo, made.map_x, made.map_y, cv2.INTER_LINEAR)
        pictures.append(np.where(made.valid, out, np.nan))
    both = np.isfinite(pictures[0]) & np.isfinite(pictures[1])
    assert both.mean() > 0.5
    # 40 waves in 2π·220 rows: 0.1 px is 2.3 grey levels at the steepest.
    assert np.sqrt(np.mean((pictures[0] - pictures[1])[both] ** 2)) < 2.3


@pytest.mark.parametrize("kind", ROW_ALIGNED)
def test_disparity_is_distance(kind: str) -> None:
    view = VIEWS[kind]
    rotation = rotation_matrix(PLACE[0])
    pair = rectified_pair(TRUE_LENS, TRUE_LENS, rotation, PLACE[1])
    points = np.random.default_rng(1).uniform((-900, -900, -400), (900, 900, 1400), (3000, 3))
    pixels = [TRUE_LENS.project(points), TRUE_LENS.project(points @ rotation.T + PLACE[1])]
    first, second, inside = shown(pair, view, pixels)
    assert inside.sum() > 200
    np.testing.assert_allclose(first[inside, 1], second[inside, 1], atol=1e-4)
    disparity = (first - second)[inside, 0]
    assert (disparity > 0).all()
    true = points[inside] @ pair.rotations[0].T
    found = pair.points(view, first[inside], disparity)
    np.testing.assert_allclose(found, true, rtol=1e-3, atol=0.5)
    # The words of the file, as a program would take them.
    record = pair.as_record(view)
    focal, middle, baseline_x = record["focal"], record["middle"], record["baseline_x"]
    names = {"sin": np.sin, "cos": np.cos, "tan": np.tan, "focal": focal, "middle": middle}
    names |= {"baseline_x": baseline_x, "disparity": disparity}
    names |= {"column": first[inside, 0], "row": first[inside, 1]}
    words = ", ".join((record["depth"], record["point"]))
    for text in sorted(words.split(", "), key=lambda one: "abrZXY".index(one[0])):
        name, _, formula = text.partition(" = ")
        names[name] = eval(formula, {}, names)
    np.testing.assert_allclose(np.column_stack([names[axis] for axis in "XYZ"]), found, rtol=1e-6)
    if kind == "perspective":
        columns = np.column_stack([first[inside], disparity, np.ones(inside.sum())])
        four = columns @ np.array(record["Q"]).T
        np.testing.assert_allclose(four[:, :3] / four[:, 3:], found, rtol=1e-6)


@pytest.mark.parametrize(
    "place",
    [
        PLACE,
        (np.array([0.0, 0.0, 0.0]), np.array([120.0, 0.0, 0.0])),  # the second on the left
        (np.array([0.0, 0.0, 0.0]), np.array([0.0, -100.0, 0.0])),  # one above the other
        (np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, -100.0])),  # one before the other
        (np.array([0.0, np.pi, 0.0]), np.array([0.0, 0.0, 50.0])),  # back to back
        (np.array([0.0, np.pi, 0.0]), np.array([50.0, 0.0, 0.0])),
    ],
)
def test_frames_are_turns_that_agree(place: Pose) -> None:
    rotation = rotation_matrix(place[0])
    pair = rectified_pair(TRUE_LENS, TRUE_LENS, rotation, place[1])
    first, second = pair.rotations
    for turn in (first, second):
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1)
    np.testing.assert_allclose(second @ rotation, first, atol=1e-12)
    centre = first @ camera_centre(rotation, place[1])
    np.testing.assert_allclose(centre, [pair.baseline_x, 0, 0], atol=1e-9)


def test_pictures_of_a_pair_that_stands_the_usual_way_are_upright() -> None:
    left_of = rectified_pair(TRUE_LENS, TRUE_LENS, np.eye(3), np.array([120.0, 0, 0]))
    assert left_of.baseline_x == pytest.approx(-120)
    np.testing.assert_allclose(left_of.rotations[0], np.eye(3), atol=1e-12)


def test_what_has_no_common_rows_is_refused() -> None:
    with pytest.raises(ViewError, match="one place"):
        rectified_pair(TRUE_LENS, TRUE_LENS, np.eye(3), np.zeros(3))
    pair = rectified_pair(TRUE_LENS, TRUE_LENS, np.eye(3), np.array([-1.0, 0, 0]))
    view = build_view(pair, "equidistant", size=(64, 48), focal=20.0)
    with pytest.raises(ViewError, match="do not agree"):
        pair.views(view)
