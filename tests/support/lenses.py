"""Cameras that tests share: cubic ones that are no one's radial lens, and radial ones."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from cubicfish import CubicCamera
from cubicfish.fit.nearest_cubic import linear_ratios
from cubicfish.models import RadialCamera, cone_rays
from cubicfish.models.lift import lift, sphere_basis


def radial_camera(
    half_angle_deg: float = 100.0,
    *,
    k: tuple[float, float, float, float] = (-0.03, -0.002, 0.0005, -0.00005),
    centre: tuple[float, float] = (488.0, 351.0),
    image_size: tuple[int, int] = (960, 720),
) -> RadialCamera:
    """A Kannala–Brandt lens whose cone of ``half_angle_deg`` fills the photo's height."""
    theta = np.deg2rad(half_angle_deg)
    unit = RadialCamera(image_size=image_size, fx=1, fy=1, cx=0, cy=0, k=np.array(k))
    focal = 0.48 * min(image_size) / float(unit.profile(theta))
    return RadialCamera(
        image_size=image_size,
        fx=focal,
        fy=1.003 * focal,
        cx=centre[0],
        cy=centre[1],
        k=np.array(k),
    )


@functools.cache  # the last bits of its least squares may differ from call to call
def cubic_camera(
    half_angle_deg: float = 100.0, *, bend: float = 0.004, seed: int = 0
) -> CubicCamera:
    """A cubic camera near a radial lens: every coefficient is off by a little of its own."""
    radial = radial_camera(half_angle_deg)
    rays = cone_rays(np.deg2rad(half_angle_deg), 400)
    centre, scale = np.array([radial.cx, radial.cy]), radial.fx
    coefficients = linear_ratios(
        lift(rays) @ sphere_basis(), (radial.project(rays) - centre) / scale, denominator_pull=1e-3
    )
    noise = np.random.default_rng(seed).standard_normal(coefficients.shape)
    coefficients = coefficients + bend * noise
    normalisation = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]])
    P = normalisation @ coefficients @ sphere_basis().T
    return CubicCamera(
        image_size=radial.image_size,
        P=P / np.linalg.norm(P),
        max_angle_deg=half_angle_deg - 5,
        radial=radial,
    )


def smaller(camera: CubicCamera, by: int) -> CubicCamera:
    """The same camera with 1/``by`` of the pixels per side: quick to render."""
    scale = np.diag([1 / by, 1 / by, 1.0])
    scale[:2, 2] = 0.5 / by - 0.5
    P = scale @ camera.P
    radial = camera.radial
    return CubicCamera(
        image_size=(camera.image_size[0] // by, camera.image_size[1] // by),
        P=P / np.linalg.norm(P),
        max_angle_deg=camera.max_angle_deg,
        radial=RadialCamera(
            image_size=(radial.image_size[0] // by, radial.image_size[1] // by),
            fx=radial.fx / by,
            fy=radial.fy / by,
            cx=(radial.cx + 0.5) / by - 0.5,
            cy=(radial.cy + 0.5) / by - 0.5,
            k=radial.k,
        ),
    )


def random_rays(half_angle_deg: float, count: int, seed: int = 0) -> npt.NDArray[np.float64]:
    """Unit rays (count, 3) spread evenly over a cone."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(np.cos(np.deg2rad(half_angle_deg)), 1, count)
    turn = rng.uniform(-np.pi, np.pi, count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)


def numeric_jacobian(function, point, step: float = 1e-6):
    """Central differences of function: (N, 3) -> (N, R) at each point: (N, R, 3)."""
    columns = []
    for axis in range(point.shape[-1]):
        shift = np.zeros(point.shape[-1])
        shift[axis] = step
        columns.append((function(point + shift) - function(point - shift)) / (2 * step))
    return np.stack(columns, axis=-1)
