"""Every reader takes a file or refuses it in one line; try_inputs.py gives it many more."""

import random

import pytest
from fuzz_mutations import mutated
from fuzz_readers import READERS, problem_with
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

QUICKLY = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_the_seeds_are_read(name, tmp_path):
    reader = READERS[name]
    for seed in reader.seeds():
        path = tmp_path / f"input{reader.suffix}"
        path.write_bytes(seed)
        reader.read(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
@QUICKLY
@given(number=st.integers(0, 2**32))
def test_damaged_files_are_read_or_refused_in_a_line(name, tmp_path, number):
    reader = READERS[name]
    path = tmp_path / f"input{reader.suffix}"
    path.write_bytes(mutated(reader.seeds(), reader.words, random.Random(number)))
    assert problem_with(reader, path) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
@QUICKLY
@given(data=st.binary(max_size=300) | st.text(max_size=300).map(lambda text: text.encode()))
def test_files_of_anything_are_read_or_refused_in_a_line(name, tmp_path, data):
    reader = READERS[name]
    path = tmp_path / f"input{reader.suffix}"
    path.write_bytes(data)
    assert problem_with(reader, path) is None
