"""What other programs read of the project says the same as pyproject.toml."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

import cubicfish
import cubicfish_cli

ROOT = Path(__file__).parents[2]
with (ROOT / "pyproject.toml").open("rb") as _file:
    PROJECT: dict[str, Any] = tomllib.load(_file)["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def pins(lines: list[str]) -> dict[str, str]:
    """Name -> bounds, of lines such as ``numpy >=1.26``."""
    split = [re.match(r"([A-Za-z0-9-]+)\s*(.*)", line) for line in lines]
    return {found[1].lower(): found[2] for found in split if found}


def test_versions_are_one() -> None:
    reported = {
        "pyproject.toml": PROJECT["version"],
        "CITATION.cff": yaml.safe_load(text("CITATION.cff"))["version"],
        "recipe/recipe.yaml": yaml.safe_load(text("recipe/recipe.yaml"))["context"]["version"],
    }
    reported["cubicfish"] = cubicfish.__version__
    assert set(reported.values()) == {cubicfish_cli.__version__}, reported


def test_the_recipe_asks_for_the_same_libraries() -> None:
    wanted = pins([*PROJECT["dependencies"], *EXTRAS["report"]])
    options = pins(yaml.safe_load(text("recipe/recipe.yaml"))["requirements"]["run"])
    assert options.pop("python").startswith(">=")
    conda = {"opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base"}
    wanted["opencv-python-headless"] = re.sub(
        r"\.\d+,",
        ",",
        wanted["opencv-python-headless"],  # OpenCV's wheels have a fourth number
    )
    assert options == {conda.get(name, name): bounds for name, bounds in wanted.items()}


def test_the_recipe_makes_the_same_program() -> None:
    entries = yaml.safe_load(text("recipe/recipe.yaml"))["build"]["python"]["entry_points"]
    assert entries == [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]


def test_every_promised_python_is_tested() -> None:
    promised = [line.rsplit(" ", 1)[1] for line in PROJECT["classifiers"] if ":: 3." in line]
    suite = yaml.safe_load(text(".github/workflows/tests.yml"))["jobs"]["suite"]
    # One more is tried there and not promised: no run has seen it yet.
    assert suite["strategy"]["matrix"]["python"][: len(promised)] == promised
    systems = suite["strategy"]["matrix"]["os"]
    assert [name.split("-")[0] for name in systems] == ["ubuntu", "macos", "windows"]


@pytest.mark.parametrize("name", ["Dockerfile", "justfile", ".github/workflows/release.yml",
                                  ".github/workflows/tests.yml", "CONTRIBUTING.md"])  # fmt: skip
def test_extras_and_files_that_are_named_exist(name: str) -> None:
    said = text(name)
    named = {extra for group in re.findall(r"\[([a-z,]+)\]\"", said) for extra in group.split(",")}
    assert named <= set(EXTRAS), named - set(EXTRAS)
    files = re.findall(r"\b((?:docs|benchmarks|tests|sample_data|recipe)/[\w./]+\w)", said)
    assert [file for file in files if not (ROOT / file).exists()] == []


def test_the_image_copies_what_the_build_needs() -> None:
    copied = re.search(r"^COPY (.+) \./$", text("Dockerfile"), re.MULTILINE)
    assert copied
    kept = [line[1:] for line in text(".dockerignore").splitlines() if line.startswith("!")]
    assert sorted([*copied[1].split(), "cubicfish", "cubicfish_cli"]) == sorted(kept)
    assert {PROJECT["readme"], *PROJECT["license-files"], "pyproject.toml"} <= set(kept)
