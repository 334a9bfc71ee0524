"""docs/camera-format.md and its test vectors: what a stranger's reader is held to."""

import json
import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from cubicfish.io.camera_keys import _KEYS, RADIAL_KEYS
from cubicfish.models.lift import MONOMIALS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "camera-format.md").read_text(encoding="utf-8")
VECTORS = json.loads((DOCS / "camera-test-vectors.json").read_text(encoding="utf-8"))


def numbers(value: Any) -> Any:
    """Every number of plain data, None as NaN."""
    if isinstance(value, dict | list):
        inner = value.values() if isinstance(value, dict) else value
        return [one for part in inner for one in numbers(part)]
    return [np.nan if value is None else value] if not isinstance(value, str) else []


def test_the_script_makes_the_vectors() -> None:
    spec = spec_from_file_location("test_vectors", DOCS / "test_vectors.py")
    assert spec is not None
    assert spec.loader is not None
    script = module_from_spec(spec)
    spec.loader.exec_module(script)
    made = json.loads(json.dumps(script.make()))
    np.testing.assert_allclose(numbers(made), numbers(VECTORS), rtol=0, atol=1e-8)
    assert [one["name"] for one in made["cameras"]] == ["sample", "wide"]


def test_the_page_has_the_order_and_every_key() -> None:
    table = PAGE.partition("in this order:")[2].partition("The size of P")[0]
    assert tuple(re.findall(r"`(\w+)`", table)) == MONOMIALS
    keys = set(re.findall(r"`(\w+)`", PAGE.partition("## The keys")[2].partition("## Is")[0]))
    assert {*_KEYS, "travel", "units", *RADIAL_KEYS[:5], "k4"} <= keys


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the example leaves closing to Python
@pytest.mark.parametrize("vectors", VECTORS["cameras"], ids=lambda one: one["name"])
def test_the_lines_of_numpy_pass_the_vectors(
    vectors: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "camera.yaml").write_text(yaml.safe_dump(vectors))
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "points.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for block in re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE):
        if "def project" in block or "def near" in block:
            exec(block, names)
    seen = vectors["seen"]
    assert len(seen) == 20
    assert seen[-1]["pixel_of_ray"] is None
    for kind, move in (("ray", lambda points: points), ("point", names["near"])):
        given = np.array([one[kind] for one in seen])
        expected = [one[f"pixel_of_{kind}"] or [np.nan, np.nan] for one in seen]
        found = names["project"](move(given))
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-9)
