"""One picture of several cameras: every pixel where it belongs, and no steps between cameras."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from saved_maps import every_pixel
from scipy.spatial.transform import Rotation

from cubicfish import (
    Calibration,
    CameraFileError,
    CubicCamera,
    ViewError,
    aligned_difference,
    stitch,
)
from cubicfish.models import cone_rays
from cubicfish.rigs import Body, RigCamera
from cubicfish.rigs.panorama import edge_distance
from cubicfish.scene.truth import rotation_matrix
from cubicfish.views import CentralView
from tests.cubicfish.rigs.test_stereo import calibrated as calibrated_pair

Light = Callable[[np.ndarray], np.ndarray]
PANORAMA = CentralView(
    kind="equirectangular", size=(400, 200), focal=400 / (2 * np.pi) * (1 - 1e-6)
)


@pytest.fixture(scope="module")
def camera(fitted: Calibration) -> CubicCamera:
    whole = fitted.camera
    return whole.for_photos((480, 360))  # a quarter of the pixels shows as much


@pytest.fixture(scope="module")
def ring(camera: CubicCamera) -> Body:
    """Four cameras that look out from a ring, 100 from its middle, all turned a little."""
    cameras = []
    for number, name in enumerate(("front", "right", "rear", "left")):
        turn = Rotation.from_euler("yx", [90 * number, 7 * number - 5], degrees=True).as_matrix()
        place = turn @ [0, 0, 100.0]
        cameras.append(
            RigCamera(name=name, camera=camera, rotation=turn.T, translation=-turn.T @ place)
        )
    return Body(cameras=tuple(cameras))


@cache
def rays_of(camera: object, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) of a photo."""
    x, y = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    return np.asarray(camera.unproject(np.stack([x, y], axis=-1)))  # type: ignore[attr-defined]


def photos_of(body: Body, light: Light, meet: Callable[[np.ndarray, np.ndarray], np.ndarray]):
    """Photos (H, W) float32 of ``light`` where rays (from, along), in the body's frame, meet."""
    photos = {}
    for one in body.cameras:
        along = rays_of(one.camera, one.camera.image_size) @ one.rotation
        photos[one.name] = np.nan_to_num(light(meet(one.position, along))).astype(np.float32)
    return photos


def far(place: np.ndarray, along: np.ndarray) -> np.ndarray:
    return along


def smooth(points: np.ndarray) -> np.ndarray:
    unit = points / np.linalg.norm(points, axis=-1, keepdims=True)
    return 100 + unit @ [30.0, 20.0, -25.0] + 20 * np.sin(3 * unit[..., 0] + 2 * unit[..., 1])


def test_the_camera_whose_axis_is_nearest_sees_a_ray(ring: Body) -> None:
    rays = np.array([[0.0, 0.0, 1.0], [0.2, -0.1, 1.0], [-0.3, 0.2, 1.0]])
    for one in ring.cameras:
        np.testing.assert_allclose(ring.project(rays @ one.rotation), one.camera.project(rays))


@pytest.mark.slow
def test_far_things_are_where_they_belong_all_around(ring: Body) -> None:
    made = ring.panorama(PANORAMA)
    picture, shown = made.render(photos_of(ring, smooth, far))
    assert shown.mean() > 0.999
    true = smooth(PANORAMA.rays(every_pixel(PANORAMA)))
    assert np.abs(picture - true)[shown].max() < 0.1
    assert picture.dtype == np.float32


def test_no_camera_begins_or_ends_with_a_step(ring: Body) -> None:
    made = ring.panorama(PANORAMA)
    flat = {one.name: np.zeros(one.camera.image_size[::-1], np.float32) for one in ring.cameras}
    flat["front"] += 255
    picture, _ = made.render(flat)
    assert picture.max() == 255  # where it is alone
    assert picture.min() == 0
    # Far from the poles, where two fields have little in common. There, a hundred degrees are a
    # hundred pixels; a step would be of 255.
    middle = picture[40:-40]
    assert max(np.abs(np.diff(middle, axis=axis)).max() for axis in (0, 1)) < 30


@pytest.mark.slow
def test_weights_are_distances_to_the_edge_of_the_field(camera: CubicCamera) -> None:
    distance = edge_distance(camera)
    seen = np.isfinite(rays_of(camera, camera.image_size)[..., 0])
    assert (distance[~seen] <= 2).all()
    assert (distance[seen] > 0).mean() > 0.99
    assert distance[:, [0, -1]].max() <= 1
    row, column = np.unravel_index(int(distance.argmax()), distance.shape)
    assert abs(row - camera.image_size[1] / 2) < 40
    assert abs(column - camera.image_size[0] / 2) < 150


@pytest.mark.slow
def test_things_at_the_distance_that_is_named_join(ring: Body) -> None:
    near = Body(cameras=ring.cameras, distance=600.0)

    def sphere(place: np.ndarray, along: np.ndarray) -> np.ndarray:
        off = place - near.centre
        half = along @ off
        reach = -half + np.sqrt(half**2 - off @ off + 600.0**2)
        return place + along * reach[..., None] - near.centre

    photos = photos_of(ring, smooth, sphere)
    picture, shown = near.panorama(PANORAMA).render(photos)
    true = smooth(PANORAMA.rays(every_pixel(PANORAMA)))
    # At the very edge of a field the photos' black shows through.
    assert np.quantile(np.abs(picture - true)[shown], 0.99) < 0.1
    wrong, _ = ring.panorama(PANORAMA).render(photos)
    assert np.median(np.abs(wrong - true)[shown]) > 1


def test_photos_keep_their_nature_and_what_nobody_sees_is_black(ring: Body) -> None:
    two = Body(cameras=ring.cameras[:1])
    made = two.panorama(PANORAMA)
    size = two.cameras[0].camera.image_size[::-1]
    for dtype, shape in ((np.uint8, ()), (np.uint8, (3,)), (np.uint16, (3,)), (np.uint8, (4,))):
        photo = np.full((*size, *shape), 77, dtype)
        picture, shown = made.render({"front": photo})
        assert picture.dtype == dtype
        assert picture.shape == (200, 400, *shape)
        assert (picture[shown] == 77).mean() > 0.99  # the rest mixes with black
        assert not picture[~shown].any()
        assert 0.3 < shown.mean() < 0.7


def test_what_does_not_go_together_is_said(ring: Body) -> None:
    made = ring.panorama(PANORAMA)
    photos = photos_of(ring, smooth, far)
    with pytest.raises(ViewError, match="differ in depth"):
        made.render({**photos, "left": photos["left"].astype(np.uint8)})
    with pytest.raises(ViewError, match="camera left: the photo has"):
        made.render({**photos, "left": photos["left"][:100]})
    with pytest.raises(ViewError, match="none of the cameras"):
        made.render({})
    narrow = CentralView(kind="cylindrical", size=(20, 10), focal=200.0, rotation=(0.0, np.pi, 0.0))
    with pytest.raises(ViewError, match="no camera of the rig sees"):
        Body(cameras=ring.cameras[:1]).panorama(narrow)


@pytest.mark.slow
def test_a_calibrated_rig_joins_what_its_true_lenses_see() -> None:
    rig, truth = calibrated_pair()
    photos = {}
    for one, own, place in zip(rig.cameras, truth.cameras, truth.camera_from_rig, strict=True):
        rays = rays_of(own.lens, own.lens.image_size) @ rotation_matrix(place[0])
        light = 127 + 100 * np.sin(rays @ [20.0, 0, 0]) * np.sin(rays @ [0, 20.0, 0])
        photos[one.name] = np.nan_to_num(light).astype(np.float32)
    view = CentralView.with_field("cylindrical", 120, (700, 300))
    picture = stitch(rig, photos, view)
    rays = view.rays(every_pixel(view))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    # A fitted lens may turn its rays a little, and the rig's frame is the first one's.
    first, own = rig.cameras[0], truth.cameras[0].lens
    _, turn = aligned_difference(own, first.camera, cone_rays(np.deg2rad(80), 2000))
    rays = rays @ turn.T
    true = 127 + 100 * np.sin(rays @ [20.0, 0, 0]) * np.sin(rays @ [0, 20.0, 0])
    # 2,000 grey levels per radian at the steepest, 230 pixels of the photo per radian.
    assert np.sqrt(np.mean((picture - true) ** 2)) < 1.5
    with pytest.raises(CameraFileError, match="no camera 'rear'"):
        stitch(rig, {"rear": photos["left"]}, view)
