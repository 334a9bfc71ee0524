"""docs/library.md is one session: its code runs as it stands there, and prints what is shown."""

import contextlib
import importlib
import inspect
import io
import math
import re
from pathlib import Path
from typing import Any

import pytest
from samples import SAMPLE

import cubicfish.views
import cubicfish_cli

TEXT = (Path(__file__).parents[2] / "docs" / "library.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"\d+\.\d*(?:e[+-]?\d+)?")


def same(shown: str, printed: str) -> bool:
    """Words, whole numbers and layout as shown; other numbers nearly so."""
    if NUMBER.sub("#", " ".join(shown.split())) != NUMBER.sub("#", " ".join(printed.split())):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    # Libraries differ in what corners they find to a hundredth of a pixel.
    return all(math.isclose(float(a), float(b), rel_tol=0.02, abs_tol=0.021) for a, b in pairs)


@pytest.mark.parametrize(
    ("shown", "printed", "is_same"),
    [
        ("fit 0.022 px", "fit 0.025 px", True),
        ("fit 0.022 px", "fit 0.060 px", False),
        ("[ 25.  25.]", "[25. 25.]", False),
        ("4 photos", "5 photos", False),
        ("97.6° off", "97.9° off", True),
        ("a", "a\nb", False),
    ],
)
def test_what_counts_as_the_same(shown: str, printed: str, is_same: bool) -> None:
    assert same(shown, printed) is is_same


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_the_guide_runs_and_prints_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sample_data").symlink_to(SAMPLE)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "guide"}
    printed = ""
    for language, text in BLOCKS:
        if language == "text":
            assert same(text, printed), f"the guide shows\n{text}\nand this is printed\n{printed}"
            printed = ""
            continue
        assert language == "python"
        assert not printed, f"the guide does not show what is printed:\n{printed}"
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(text, f"library.md: {text[:40]!r}", "exec"), names)
        printed = out.getvalue()
    assert not printed
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["film.avi", "frames", "sample_data", "saved"]


def test_every_name_of_the_program_is_in_its_table_and_no_other() -> None:
    table = TEXT.split("## All names of the program")[1]
    cells = re.findall(r"^\| (.*?) \|", table, re.MULTILINE)[2:]
    results = re.findall(r"(?:→|gives a) `(\w+)`", table)
    named = [*re.findall(r"`(\w+)`", " ".join(cells)), *results]
    library = {*cubicfish.__all__, *cubicfish.views.__all__}
    own = sorted({*cubicfish_cli.__all__} - library)
    assert sorted(name for name in named if name not in library) == own


def inside(thing: Any) -> Any:
    """What is behind the check of arguments."""
    return thing.__wrapped__ if hasattr(thing, "checked_arguments") else thing


def test_every_public_name_is_on_the_page_of_functions() -> None:
    page = (Path(__file__).parents[2] / "docs" / "api.md").read_text(encoding="utf-8")
    shown = [place.rpartition(".") for place in re.findall(r"^::: (\S+)$", page, re.MULTILINE)]
    described = [getattr(importlib.import_module(module), name) for module, _, name in shown]
    public = [getattr(cubicfish_cli, name) for name in cubicfish_cli.__all__]
    ids = [sorted(id(inspect.unwrap(thing)) for thing in things) for things in (described, public)]
    assert ids[0] == ids[1]


def test_every_function_is_used_in_the_guide() -> None:
    code = "\n".join(text for language, text in BLOCKS if language == "python")
    functions = [name for name in cubicfish_cli.__all__ if name.islower()]
    assert [name for name in functions if f"{name}(" not in code and name != "save_target"] == []
