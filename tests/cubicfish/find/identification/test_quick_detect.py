"""Quick detection finds nearly what the full one does, and nothing where that finds nothing."""

import cv2
import numpy as np
import pytest
from samples import SAMPLE

from cubicfish.find.detection.finder import find_grids
from cubicfish.find.identification.quick_detect import quick_detect
from cubicfish.photos.photos import read_grey


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_grids_are_where_full_detection_finds_them(share: float) -> None:
    for path in sorted((SAMPLE / "photos").glob("*.jpg"))[:2]:
        photo = cv2.resize(read_grey(path), None, fx=share, fy=share)
        seen, found = quick_detect(photo, None), find_grids(photo)
        assert seen.image_size == found.image_size
        assert 2 <= len(seen.grids) <= len(found.grids) == 3
        for grid in seen.grids:
            apart = [
                np.linalg.norm(grid.pixel[:, None] - other.pixel, axis=2).min(axis=1)
                for other in found.grids
            ]
            best = int(np.argmin([np.median(one) for one in apart]))
            other = found.grids[best]
            assert np.median(apart[best]) < 0.3
            assert np.quantile(apart[best], 0.9) < 1
            assert len(grid) > 0.8 * len(other)
            assert grid.step == pytest.approx(other.step, rel=0.1)
            assert tuple(grid.cells.min(axis=0)) == (0, 0)


def test_there_are_none_in_noise_or_nothing() -> None:
    noise = np.random.default_rng(2).integers(0, 255, (400, 700)).astype(np.uint8)
    cells = np.kron(noise[:70, :100] > 127, np.full((8, 8), 200)).astype(np.uint8)[:, :700]
    for photo in (noise, np.full((400, 700), 90, np.uint8), noise[:12, :12], cells):
        seen = quick_detect(photo, None)
        assert seen.grids == ()
        assert seen.image_size == photo.shape[::-1]
