"""The faults of tests/mutations still fit the code: each line that they break stands there once."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
MUTATIONS = runpy.run_path(str(TESTS / "mutations" / "mutations.py"))["MUTATIONS"]


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.module)
def test_the_line_stands_there_once(mutation):
    module = TESTS.parent / "cubicfish_cli" / mutation.module
    assert module.read_text(encoding="utf-8").count(mutation.right) == 1
    assert mutation.wrong != mutation.right
    assert all((TESTS / f"test_{name}.py").is_file() for name in mutation.tests)
