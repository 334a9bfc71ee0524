"""What is measured of frames, and which pictures are chosen by it."""

import cv2
import numpy as np
import pytest

pytest.importorskip("av")

from filming import photos

from cubicfish.geometry import outermost
from cubicfish_cli.films.choose import FEWEST, Patch, Seen, _find_tilt, _Views, choose
from cubicfish_cli.films.measure import motion, sharpness, small_picture

SIZE = (480, 360)


def at(x: float, y: float, sharp: float = 0.6, moved: float = 0.0) -> Seen:
    column, row = (part.ravel() for part in np.meshgrid(np.arange(4), np.arange(3)))
    cells = np.column_stack([column, row])
    pixel = np.column_stack([x + 15.0 * column, y + 15.0 * row])
    return Seen(patches=(Patch(board=0, cells=cells, pixel=pixel),), sharpness=sharp, motion=moved)


class Fixed:
    """What pictures add, as shares of what is wanted."""

    def __init__(self, gains: list[float]) -> None:
        self._gains = gains

    def of(self, picture: int) -> float:
        return self._gains[picture]

    def share(self, gain: float) -> float:
        return gain

    def take(self, picture: int) -> None:
        pass


def test_what_adds_less_than_is_worth_its_time_is_not_chosen() -> None:
    pictures = [at(40 + 40 * number, 40) for number in range(12)]
    for last, chosen, ended in ((0.005, 11, "enough"), (0.02, 12, "all")):
        gains = [0.5] * 11 + [last]
        found = choose(pictures, SIZE, 20, 0.6, lambda quality, g=gains: Fixed(g))
        assert (found.order, found.ended) == (tuple(range(chosen)), ended)


def test_as_many_are_chosen_as_were_asked_for_while_they_add_something() -> None:
    pictures = [at(40 + 40 * number, 40 + 100 * row) for row in range(3) for number in range(10)]
    for most, ended in ((12, "asked"), (29, "asked"), (30, "all"), (60, "all")):
        found = choose(pictures, SIZE, most, 0.6, lambda quality: Fixed([0.011] * 30))
        assert (len(found.order), found.ended) == (min(most, 30), ended)


def test_different_views_are_taken_where_there_are_few() -> None:
    """A lens is told from the poses of one flat board by many views, which each add little."""
    pictures = [at(40, 40), at(300, 40), at(40, 240)]
    for last in (0.05, 0.0):
        found = choose(pictures, SIZE, 9, 0.6, lambda quality, g=last: Fixed([0.5, 0.3, g]))
        assert (found.order, found.ended) == ((0, 1, 2), "all")


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_blur_of_any_kind_lowers_sharpness_and_light_does_not(turned: bool) -> None:
    streak = np.zeros((9, 9), np.float32)
    streak[4] = 1 / 9
    for photo in photos(3):
        plain = sharpness(photo)
        for spoilt in (
            cv2.GaussianBlur(photo, (0, 0), 2),
            cv2.filter2D(photo, -1, streak.T if turned else streak),
        ):
            assert sharpness(spoilt) < 0.75 * plain
        assert sharpness(photo // 2 + 60) == pytest.approx(plain, rel=0.05)


def test_a_picture_without_edges_has_no_sharpness() -> None:
    assert sharpness(np.full((90, 120), 128, np.uint8)) == 0


@pytest.mark.slow
def test_motion_grows_with_the_shift_and_not_with_the_light() -> None:
    photo = photos(3)[0]
    small = small_picture(photo)

    def to(other: np.ndarray) -> float:
        return motion(small, small_picture(other), photo.shape[1])

    shifts = [to(np.roll(photo, (n, n), (0, 1))) for n in (0, 1, 2, 4)]
    assert shifts[0] == 0
    assert np.all(np.diff(shifts) > 0.3)
    assert shifts[2] == pytest.approx(2 * np.sqrt(2), rel=0.4)
    assert to((photo * 0.8).astype(np.uint8)) < 0.3


def test_spoilt_pictures_come_last_and_only_where_good_ones_are_too_few() -> None:
    good = [at(40 + 40 * number, 40) for number in range(FEWEST)]
    bad = [at(300, 240, sharp=0.3), at(180, 140, moved=9.0)]
    made = choose([*bad, *good], SIZE, 20, 0.6, lambda quality: Fixed([0.5] * 12))
    assert sorted(made.order) == list(range(2, 12))
    made = choose([*bad, *good[:-1]], SIZE, 20, 0.6, lambda quality: Fixed([0.5] * 11))
    assert set(made.order[: FEWEST - 1]) == set(range(2, 11))
    assert len(made.order) == FEWEST


def test_near_copies_are_never_chosen_and_what_is_new_comes_first() -> None:
    seen = [at(40, 40), at(40.4, 40.2), at(60, 50), at(300, 240), Seen(patches=(), sharpness=0.6)]
    made = choose(seen, SIZE, 9, 0.6)
    assert len(made.order) == 3
    assert made.order.index(3) == 1  # after the first, what is elsewhere
    assert {2, 3} < set(made.order) < {0, 1, 2, 3}
    assert made.gain[1] > made.gain[2]
    assert choose(seen, SIZE, 2, 0.6).order == made.order[:2]


def test_near_views_come_after_all_others_and_while_they_add_something() -> None:
    seen = [at(40, 40), at(44, 42), at(300, 240), at(304, 242)]
    made = choose(seen, SIZE, 9, 0.6, lambda quality: Fixed([0.5, 0.4, 0.3, 0.2]))
    assert (made.order, made.ended) == ((0, 2, 1, 3), "all")
    far = [at(40 + 40 * number, 40) for number in range(FEWEST)]
    for last, count in ((0.005, 10), (0.02, 11)):
        gains = [0.5] * 10 + [last]
        made = choose([*far, at(44, 42)], SIZE, 20, 0.6, lambda quality, g=gains: Fixed(g))
        assert len(made.order) == count


def test_copies_are_told_by_their_place_where_names_are_uncertain() -> None:
    """Of a part of a board it may not be known which rows it shows; a copy may name other ones."""

    def part(first_row: int, x: float, *, certain: bool) -> Seen:
        (patch,) = at(x, 40).patches
        moved = patch.cells + np.array([0, first_row])
        return Seen(
            patches=(Patch(board=0, cells=moved, pixel=patch.pixel, certain=certain),),
            sharpness=0.6,
        )

    for certain, taken in ((False, {0, 2, 3}), (True, {0, 1, 2, 3})):
        # The second is a copy that is named one row further on, the third is elsewhere under the
        # names of the first.
        seen = [part(0, 40, certain=certain), part(1, 40.5, certain=certain)]
        seen += [part(0, 300, certain=certain), at(160, 240)]
        assert len(choose(seen, SIZE, 9, 0.6).order) == len(taken)
    # Nor do certain names say anything of uncertain ones.
    assert len(choose([part(1, 40.5, certain=False), at(40, 40)], SIZE, 9, 0.6).order) == 1


def test_each_side_that_a_board_is_seen_from_is_told_from_the_others() -> None:
    (patch,) = at(200, 150).patches
    middle = patch.pixel.mean(axis=0)
    sides = {_find_tilt(patch)}
    for towards in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        off = patch.pixel - middle
        grown = middle + off * (1 + off @ np.array(towards) / 80)[:, None]
        sides.add(_find_tilt(Patch(board=0, cells=patch.cells, pixel=grown)))
    assert sides == {0, 1, 2, 3, 4}


@pytest.mark.parametrize("certain", [True, False])
def test_distances_are_medians_of_what_two_views_have_in_common(certain: bool) -> None:
    random = np.random.default_rng(1)
    cells = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2)
    pictures = [Seen(sharpness=0.6)]
    for count in (1, 3, 6, 12, 19, 20, 20, 20):
        own = cells[random.permutation(20)[:count]]
        pixel = 20.0 * own + random.normal(0, 9, own.shape) + random.uniform(0, 90, 2)
        patch = Patch(board=1, cells=own, pixel=pixel, certain=certain or count % 2 == 0)
        pictures.append(Seen(sharpness=0.6, patches=(patch,)))
    views = _Views(pictures, SIZE)
    for one, first in enumerate(pictures):
        found = views.measure_distances(one)
        for other, second in enumerate(pictures):
            fewer = min(first.corners, second.corners)
            if not max(first.corners, second.corners):
                assert found[other] == -np.inf
                continue
            by_names = all(patch.certain for patch in (*first.patches, *second.patches))
            if by_names:
                place = {name: at for at, name in enumerate(second.names.tolist())}
                pairs = [(a, place[n]) for a, n in enumerate(first.names.tolist()) if n in place]
                use = len(pairs) >= max(1, min(4, fewer)) and 2 * len(pairs) >= fewer
                apart = [first.pixel[a] - second.pixel[b] for a, b in pairs]
            else:
                use = fewer > 0
                apart = outermost(first.pixel) - outermost(second.pixel) if use else []
            expected = np.median(np.linalg.norm(apart, axis=1)) / np.hypot(*SIZE) if use else np.inf
            assert found[other] == pytest.approx(expected, rel=1e-12)
