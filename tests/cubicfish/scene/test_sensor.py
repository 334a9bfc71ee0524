import numpy as np
import pytest

from cubicfish.scene.photos import bloomed, sensed

HALF = 40
FINE = 8


def drawn_corner(dark: float = 0.07, light: float = 0.92) -> np.ndarray:
    """Two dark squares that meet at the middle pixel's middle, with sides along x and y."""
    place = (np.arange((2 * HALF + 1) * FINE) + 0.5) / FINE - 0.5 - HALF
    ink = np.multiply.outer(np.sign(place), np.sign(place)) > 0
    cell = np.where(ink, dark, light).reshape(2 * HALF + 1, FINE, 2 * HALF + 1, FINE)
    return cell.mean(axis=(1, 3))


def photo(exposure: float) -> np.ndarray:
    return sensed(drawn_corner(), exposure=exposure, blur=0.7, noise=0, seed=0).astype(float)


def falls_to(profile: np.ndarray, level: float) -> float:
    """Where a profile first falls to a level, in steps."""
    k = int(np.argmax(profile < level))
    return k - 1 + (profile[k - 1] - level) / (profile[k - 1] - profile[k])


def gap_px(exposure: float) -> float:
    """The gap between the two dark squares, along their common diagonal."""
    middle = np.diagonal(photo(exposure))[HALF:]
    return 2 * np.sqrt(2) * falls_to(middle, 128) if middle[0] > 128 else 0.0


def test_dark_squares_come_apart_by_the_exposure():
    gaps = [gap_px(exposure) for exposure in (1, 1.2, 1.5, 2, 2.5)]
    assert gaps[0] == 0
    assert (np.diff(gaps) > 0.3).all()
    assert gaps[2] == pytest.approx(1.8, abs=0.3)
    assert 3.5 < gaps[-1] < 4.7


def test_the_middle_of_the_gap_is_the_corner():
    picture = photo(2)
    np.testing.assert_array_equal(picture, picture[::-1, ::-1])
    np.testing.assert_array_equal(picture, picture.T)


def test_a_straight_edge_moves_as_the_overflow_says():
    """White of 255 + over beside black: the dark side receives over times the kernel's tail."""
    over = 300.0
    level = np.zeros((41, 60))
    level[:, :30] = 255 + over
    offset = np.arange(-9, 10)
    kernel = np.exp(-np.hypot(offset[:, None], offset) / 0.8)
    across = kernel.sum(axis=0) / kernel.sum()
    tail = [over * across[offset >= 1 + step].sum() for step in range(6)]
    np.testing.assert_allclose(bloomed(level)[20, 30:36], tail, rtol=1e-9)
    assert (bloomed(level)[20, :30] >= 255).all()


def test_nothing_spills_where_nothing_is_full():
    level = np.random.default_rng(0).uniform(0, 255, (20, 30))
    assert bloomed(level) is level


def test_noise_is_of_the_size_that_is_asked():
    flat = sensed(np.full((200, 200), 0.5), exposure=1, blur=0, noise=4, seed=3).astype(float)
    assert flat.mean() == pytest.approx(123, abs=0.2)
    assert flat.std() == pytest.approx(4, rel=0.03)
