from dataclasses import dataclass, field

import numpy as np
import pytest

from cubicfish.types import FloatArray
from cubicfish.wording import Brief, did_you_mean, listed, quoted


def test_quotes_are_one_short_printable_line() -> None:
    assert quoted("floor") == "'floor'"
    assert quoted("a\nb\x1b[31m") == r"'a\nb\x1b[31m'"
    assert quoted("x" * 1000) == "'" + "x" * 57 + "...'"
    assert quoted([1, 2]) == "'[1, 2]'"


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("sqare", "did you mean 'square'?"),
        ("SQUARE", "did you mean 'square'?"),
        ("zzz", "known: corners, square"),
    ],
)
def test_the_nearest_known_word_is_named(word: str, said: str) -> None:
    assert did_you_mean(word, ["corners", "square"]) == said


def test_a_long_list_is_cut() -> None:
    said = did_you_mean("zzz", [f"k{n}" for n in range(30)])
    assert said.endswith("k11, and 18 more")


def test_choices_are_listed_as_one_says_them():
    lists = [listed(words, word="or") for words in ("a", "ab", "abc")]
    assert lists == ["a", "a or b", "a, b or c"]


@dataclass(repr=False)
class Shown(Brief):
    size: tuple[int, int] = (960, 720)
    P: FloatArray = field(default_factory=lambda: np.zeros((3, 20)))
    names: tuple[str, ...] = ("a",) * 1000
    inner: object = None


def test_a_record_shows_as_one_short_line() -> None:
    inner = Shown(inner="x" * 200)
    assert repr(Shown(inner=inner)) == "<Shown: size (960, 720), P 3x20, names 1000, inner Shown>"
    assert len(repr(inner)) == 100
