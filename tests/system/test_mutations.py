"""The faults of mutations/ still fit the code: each line that they break stands there once."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
MUTATIONS = runpy.run_path(str(HERE / "mutations" / "mutations.py"))["MUTATIONS"]


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.module)
def test_the_line_stands_there_once(mutation):
    module = ROOT / mutation.module
    assert module.read_text(encoding="utf-8").count(mutation.right) == 1
    assert mutation.wrong != mutation.right
    assert all((ROOT / "tests" / f"{name}.py").is_file() for name in mutation.tests)
