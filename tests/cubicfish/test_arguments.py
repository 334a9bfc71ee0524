"""Arguments are what annotations say, or the error says what they must be."""

import pickle
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

import numpy as np
import numpy.typing as npt
import pytest

import cubicfish
from cubicfish.arguments import checked, refuse_misfit
from cubicfish.errors import UsageError

if TYPE_CHECKING:
    from cubicfish.target.target import Target

Level = Literal["off", "shape"]


class Camera(Protocol):
    size: int

    def project(self) -> None: ...


class Sees:
    size = 3

    def project(self) -> None: ...


@dataclass(frozen=True)
class Options:
    checked_fields: ClassVar = True

    names: "Sequence[str]" = ()
    target: "Target | None" = None


FITS = [
    (3, int), (np.int64(3), int), (3, float), (np.float32(3), float), (True, bool),
    (np.True_, bool), ("a", str), (None, int | None), ("off", Level), (Path("a"), str | Path),
    ([1, 2], Sequence[int]), (np.arange(3), Sequence[int]), ((1, 2), tuple[int, int]),
    ([1, 2], tuple[int, int]), (range(3), Iterable[int]), ({"a": 1}, Mapping[str, int]),
    ([[1, 2]], npt.ArrayLike), (np.eye(3), npt.NDArray[np.float64]), (Sees(), Camera),
    (object(), Any), (Options(names=["a"]), Options), (["a"], str | Sequence[str]),
    ({"a": np.eye(2)}, Mapping[str, npt.NDArray[Any]] | Iterable[str]),
]  # fmt: skip
MISFITS = [
    (None, int, "a whole number, not None"),
    (True, int, "a whole number, not True"),
    (1.5, int, "a whole number, not 1.5"),
    (float("nan"), float, "a number, not nan"),
    ("3", float, "a number, not '3'"),
    (0, bool, "True or False, not 0"),
    (b"a", str, "text, not a bytes"),
    ("a\0", str, r"text, not 'a\x00'"),
    ("of", Level, "'off' or 'shape', not 'of': did you mean 'off'?"),
    (3, Level | None, "'off', 'shape' or None, not 3"),
    (3, str | Path, "text or a path, not 3"),
    ("ab", Sequence[str], "a list of some, each text, not 'ab'"),
    ((1, 2, 3), tuple[int, int], "a list of 2, each a whole number, not a tuple"),
    (np.arange(2), tuple[int, int], "a list of 2, each a whole number, not an array"),
    ([], Mapping[str, int], "a mapping to a whole number, not an empty list"),
    (None, npt.ArrayLike, "an array, not None"),
    ({}, npt.NDArray[Any], "an array, not an empty dict"),
    (object(), Camera, "a Camera, not an object: load_camera(path).camera is one"),
    ("x", Options, "an Options, not 'x'"),
    (3, range, "a range, not 3"),
    ([], dict, "a dict, not an empty list"),
]


@pytest.mark.parametrize(("value", "kind"), FITS)
def test_what_fits_is_taken(value: Any, kind: Any) -> None:
    refuse_misfit("it", value, kind)


@pytest.mark.parametrize(("value", "kind", "must"), MISFITS)
def test_what_does_not_is_named(value: Any, kind: Any, must: str) -> None:
    with pytest.raises(UsageError) as refused:
        refuse_misfit("it", value, kind)
    assert str(refused.value) == f"it must be {must}"


@pytest.mark.parametrize(
    ("value", "kind", "place"),
    [
        ([1, "a"], Sequence[int], "it[1] must be a whole number"),
        (np.array([0.5, 1]), Sequence[int], "it[0] must be a whole number"),
        ({"a": None}, Mapping[str, int], "it['a'] must be a whole number"),
        ({1: 1}, Mapping[str, int], "a key of it must be text"),
        (Options(names="ab"), Options, "it.names must be a list"),
        (Options(target="t.yaml"), Options, "it.target must be a Target or None"),
        (["a", None], str | Sequence[str], "it[1] must be text"),
    ],
)
def test_the_place_inside_is_named(value: Any, kind: Any, place: str) -> None:
    with pytest.raises(UsageError) as refused:
        refuse_misfit("it", value, kind)
    assert str(refused.value).startswith(place)


def test_a_checked_function_is_as_it_was() -> None:
    def double(number: int, *, times: float = 2.0) -> float:
        """Say it."""
        return number * times

    held = checked(double, "somewhere")
    assert held(3, times=3.0) == 9
    assert held.__doc__ == "Say it."
    assert checked(held, "elsewhere") is held
    with pytest.raises(UsageError, match=r"^times must be a number, not 'a'$"):
        held(3, times="a")
    for call in (lambda: held(), lambda: held(1, 2), lambda: held(1, other=3)):
        with pytest.raises(TypeError, match="double"):
            call()


def test_a_function_of_the_face_goes_to_other_processes() -> None:
    assert pickle.loads(pickle.dumps(cubicfish.build_map)) is cubicfish.build_map
