"""Lengths as people write and read them."""

import pytest

from cubicfish_cli.render.difference_picture import round_up
from cubicfish_cli.words.camera import pupil_words
from cubicfish_cli.words.phrases import length_words, two_digits


@pytest.mark.parametrize(
    ("length", "units", "words"),
    [
        (403, "mm", "40 cm"), (0.31, "m", "31 cm"), (2340, "mm", "2.3 m"), (7, "mm", "7.0 mm"),
        (1110, "millimetres", "1.1 m"), (0.31, "inch", "0.31 inch"), (12.4, "side", "12 side"),
        (0, "mm", "0 mm"), (1110, "", "1100"),
    ],
)  # fmt: skip
def test_a_length_has_two_digits_in_a_unit_that_suits_it(length, units, words):
    assert length_words(length, units) == words


def test_two_digits_are_never_a_power_of_ten():
    assert [two_digits(value) for value in (1234, 5.076, 0.0517, 0)] == [
        "1200",
        "5.1",
        "0.052",
        "0",
    ]


@pytest.mark.parametrize(
    ("value", "up"), [(0.3, 0.5), (0.5, 0.5), (0.51, 1), (1, 1), (1.2, 2), (77, 100), (0, 1e-6)]
)
def test_scales_end_at_round_numbers(value, up):
    assert round_up(value) == pytest.approx(up)


@pytest.mark.parametrize(("rim_px", "way"), [(0.62, "outward"), (-0.62, "inward")])
def test_which_way_near_things_are_displaced_is_said_in_words(rim_px, way):
    said = pupil_words(rim_px, 153, "mm")
    assert said == f"close objects (15 cm) shift {way} by 0.6 px at the rim"
