"""YAML of plain data: what is written is what is read; everything else is refused cheaply."""

import re
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cubicfish.errors import TargetError
from cubicfish.files.plain_yaml import load_plain_yaml, parse_plain_yaml, plain_yaml_text


def load(tmp_path: Path, text: str | bytes) -> Any:
    path = tmp_path / "a.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_plain_yaml(path, error=TargetError)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("no", "no"),
        ("010", 10),
        ("1e-3", 1e-3),
        ("-.5", -0.5),
        ("+4.", 4.0),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("0x1F", "0x1F"),
        ("~", None),
        ("", None),
        ("'12'", "12"),
        ("TRUE", True),
        ("-.inf", -float("inf")),
        ("1e999", float("inf")),
        ("<<", "<<"),
    ],
)
def test_scalars_follow_the_core_schema(tmp_path: Path, text: str, value: object) -> None:
    read = load(tmp_path, f"a: {text}\n")["a"]
    assert read == value
    assert type(read) is type(value)


def test_not_a_number_is_read_as_such(tmp_path: Path) -> None:
    read = load(tmp_path, "[.nan]")[0]
    assert read != read


# PyYAML leaves some text bare that is a number in YAML 1.2, such as 0E0: it follows YAML 1.1.
texts = st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=20).filter(
    lambda text: not re.fullmatch(r"[-+]?[0-9.]+[eE][-+]?[0-9]+", text)
)
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**15), 10**15) | st.floats(allow_nan=False) | texts,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text("abcdef", min_size=1, max_size=5), inner, max_size=4)
    ),
    max_leaves=12,
)


@pytest.mark.slow
@given(plain.filter(lambda value: value is not None))
def test_what_pyyaml_writes_is_read_back(tmp_path_factory: Any, value: object) -> None:
    text = yaml.safe_dump(value, allow_unicode=True)
    if "&id" not in text:
        assert load(tmp_path_factory.mktemp("y"), text) == value


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path: Path) -> None:
    assert load(tmp_path, b"\xef\xbb\xbfa: 1\r\nb: x\r\n") == {"a": 1, "b": "x"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: &x [1]\nb: *x\n", "line 1: anchors and aliases"),
        ("a: 1\nb: *x\n", "line 2: anchors and aliases"),
        ("a: !!python/object:os.system x\n", r"line 1: tags \(!\)"),
        ("a: !t x\n", r"line 1: tags \(!\)"),
        ("a: 1\na: 2\n", "line 2: the key 'a' is there twice"),
        ("[a]: 1\n", "line 1: a key must be text"),
        ("a: 1\n---\nb: 1\n", "line 2: a second document"),
        ("[" * 50 + "]" * 50, "nested more than 12 levels"),
        ("a: [1\nb: 2\n", "line 2: not valid YAML"),
        ("a: \t- x\n\tb: 1", "not valid YAML"),
        ("a: \x01\n", "not valid YAML"),
        ("a: " + "9" * 5000, "line 1: a number with too many digits"),
        ("", "is empty"),
        ("# only a comment\n", "is empty"),
        (b"\xff\xfea\x00", "is not UTF-8 text"),
        (b"\x89PNG\r\n\x1a\n\x00", "is not UTF-8 text"),
        ("a" * 1_000_001, "larger than 1 MB"),
    ],
)
def test_more_than_plain_data_is_refused_in_one_line(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(TargetError, match=message) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "a.yaml"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "[" * 900_000,
        "{a: " * 200_000,
        "- " * 400_000,
        "a: &a [x,x,x,x,x,x,x,x,x]\n"
        + "".join(
            f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(20)
        ),
    ],
)
def test_hostile_nesting_is_refused_quickly(tmp_path: Path, text: str) -> None:
    start = time.perf_counter()
    with pytest.raises(TargetError):
        load(tmp_path, text)
    assert time.perf_counter() - start < 5  # a fraction of a second; unbounded when parsed whole


@pytest.mark.parametrize("name", ["missing.yaml", "."])
def test_an_unreadable_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(TargetError, match=r"does not exist|cannot be read: Is a directory"):
        load_plain_yaml(tmp_path / name, error=TargetError)


@pytest.mark.parametrize("text", ["08", "1e3", "010", "+4.", "-.inf", "null", "True", "no", "1_0"])
def test_text_that_looks_like_a_number_stays_text(text: str) -> None:
    assert written_and_read({text: text}) == {text: text}


@given(st.text(alphabet="0123456789eE+-._:xo", max_size=8))
def test_any_text_of_digits_and_marks_stays_text(text: str) -> None:
    assert written_and_read([text]) == [text]


def written_and_read(record: Any) -> Any:
    return parse_plain_yaml(Path("a.yaml"), plain_yaml_text(record), error=TargetError)
