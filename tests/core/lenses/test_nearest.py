"""The lens nearest to given pixels, from a start that is near, and from one that is not."""

from dataclasses import replace

import numpy as np
import pytest

from cubicfish_cli.core.lenses.nearest import nearest_from_near, nearest_lens
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.lenses.sphere import cone_rays

LENS = RadialCamera(
    image_size=(640, 480), fx=210.0, fy=211.0, cx=322.0, cy=237.0, k=np.array([0.02, -3e-3, 0, 0])
)
RAYS = cone_rays(1.4, 300)


def pixels(share: float) -> np.ndarray:
    """Of a lens that is off by so much, and of no model: no lens meets them."""
    other = replace(LENS, fx=LENS.fx * (1 + share), cx=LENS.cx + 100 * share, k=LENS.k * 1.5)
    wave = np.sin(5 * RAYS[:, :2]) * share * 20
    return np.asarray(other.project(RAYS) + wave)


@pytest.mark.parametrize("share", [1e-4, 1e-2, 0.1])
def test_few_steps_from_near_find_the_lens_of_least_squares(share: float) -> None:
    wanted = pixels(share)
    found = nearest_from_near(LENS, RAYS, wanted, held=["k4"])
    assert found.k[3] == 0
    best = nearest_lens([LENS], RAYS, wanted, held=["k4"])
    assert np.abs(found.project(RAYS) - best.project(RAYS)).max() < 1e-3 * share
    assert np.abs(LENS.project(RAYS) - best.project(RAYS)).max() > 10 * share


def test_where_steps_lead_no_nearer_the_start_stays() -> None:
    assert nearest_from_near(LENS, RAYS, np.full((len(RAYS), 2), np.nan)) is LENS
