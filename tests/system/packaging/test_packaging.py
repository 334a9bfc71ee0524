"""The program as its users have it: no network, no file but what was asked for, any home."""

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from fnmatch import fnmatch
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging_content import PROJECT, load_project, lower_bounds, package_version, project_files
from packaging_programs import GUARD, SAMPLE
from packaging_runs import CACHE, QUICK, Sandbox, Step, wrongly_written

from cubicfish_cli.render.drawing import REPORT

HERE = Path(__file__).parent
REPORTS = all(find_spec(name) for name in REPORT)


@dataclass(frozen=True, kw_only=True)
class Chain:
    """What a chain of commands did in its sandbox."""

    sandbox: Sandbox
    steps: list[dict]
    guarded: list[str]


def run_chain(folder: Path, *lines: str, **more: str) -> Chain:
    sandbox = Sandbox(base=folder / "sandbox").make()
    record, guard = folder / "steps", folder / "guard"
    environment = sandbox.environment(
        PYTHONPATH=os.pathsep.join([str(GUARD), str(PROJECT)]),
        GUARD_RECORD=str(guard),
        **more,
    )
    done = subprocess.run(
        [sys.executable, "-B", "-W", "error", HERE / "packaging_chain.py", sandbox.base, SAMPLE,
         record, *lines],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "Warning" not in done.stderr
    return Chain(
        sandbox=sandbox,
        steps=[json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()],
        guarded=guard.read_text(encoding="utf-8").splitlines() if guard.exists() else [],
    )


@pytest.mark.slow
def test_the_usual_commands(tmp_path: Path) -> None:
    """One test, so that parallel runs of the suite run the chain once."""
    chain = run_chain(tmp_path)
    able = [step for step in QUICK if step.extra is None or REPORTS]
    steps = [step for step in chain.steps if step["step"] in {step.name for step in able}]
    assert len(steps) == len(able)
    assert [step for step in steps if step["code"]] == []
    assert [step for step in steps if step["wrong"]] == []
    assert any(fnmatch(name, f"home/{CACHE}/*.npz") for name in below(chain, "home"))
    assert below(chain, "tmp") == []
    # Nothing reaches for a network, and the only programs asked are fc-list (by matplotlib, for
    # fonts) and lscpu (by numpy before 2, for the processor).
    programs = {line.split("'")[1] for line in chain.guarded if line.startswith("program")}
    assert {Path(name).name for name in programs} <= {
        "fc-list",
        "lscpu",
        Path(sys.executable).name,
    }
    assert [line for line in chain.guarded if not line.startswith("program")] == []
    drawn = [
        path for path in chain.sandbox.work.rglob("*") if path.suffix in (".svg", ".html", ".pdf")
    ]
    assert {path.suffix for path in drawn} == ({".svg", ".pdf", ".html"} if REPORTS else set())
    assert [what for path in drawn for what in loaded_by(path)] == []


def below(chain: Chain, folder: str) -> list[str]:
    """What is left in a folder of the sandbox."""
    names = chain.sandbox.files()
    return [name for name in names if name.startswith(f"{folder}/") and name != f"{folder}/"]


def loaded_by(path: Path) -> list[str]:
    """What a page, drawing or document gets from elsewhere when it is opened."""
    text = path.read_bytes().decode("latin-1")
    if path.suffix == ".pdf":
        return re.findall(r"/(?:URI|Launch|JavaScript|GoToR|SubmitForm|ImportData)\b", text)
    found = re.findall(r"@import[^;]*|url\(\s*['\"]?(?!#|data:)[^)]*", text)
    return found + [
        f"{name}={value}"
        for name, value in Attributes(text).found
        if name in ("src", "srcset", "href", "xlink:href", "data", "action", "poster")
        and not value.startswith(("#", "data:"))
    ]


class Attributes(HTMLParser):
    """All attributes of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [(name, value or "") for name, value in attrs]


@pytest.mark.parametrize(
    "text",
    [
        "<img src='https://example.org/a.png'>", "<link rel=stylesheet href=//example.org/a.css>",
        "<style>@import 'a.css';</style>", "<p style='background: url(b.png)'>",
        "<svg><image xlink:href='c.png'/></svg>",
    ],
)  # fmt: skip
def test_what_would_be_loaded_is_seen(tmp_path: Path, text: str) -> None:
    (tmp_path / "page.html").write_text(text)
    assert len(loaded_by(tmp_path / "page.html")) == 1


@pytest.mark.slow
def test_a_home_that_cannot_be_made_costs_nothing_but_time(tmp_path: Path) -> None:
    lost = run_chain(
        tmp_path,
        "detect {sample}/photos/corner_01.jpg --target {sample}/target.yaml -o corners.csv",
        "target print --object board -o boards",
        HOME="/dev/null/home",
    )
    assert [step["wrong"] for step in lost.steps] == [[], []]
    assert [step["code"] for step in lost.steps] == [0, int(not REPORTS)]
    assert below(lost, "home") == below(lost, "tmp") == []


@pytest.mark.slow
def test_nothing_is_kept_where_nothing_may_be(tmp_path: Path) -> None:
    kept = run_chain(
        tmp_path,
        "calibrate {sample}/photos --target {sample}/target.yaml --no-cache "
        "--no-hold-out --refine-target off -o calibration",
    )
    assert [(step["code"], step["wrong"]) for step in kept.steps] == [(0, [])]
    page = kept.sandbox.work / "calibration" / "report.html"
    assert page.exists() == REPORTS
    assert below(kept, "home") == below(kept, "tmp") == []


def test_what_is_written_unasked_is_seen() -> None:
    step = Step(args=("map", "map.npz"), writes=("map.npz",))
    before = {"work/": "", "work/kept": "1"}
    assert wrongly_written(step, before, {**before, "work/map.npz": "2"}) == []
    assert wrongly_written(step, before, before) == ["work/map.npz was not written"]
    for name in ("tmp/left", "home/.config/", "work/other.npz", "work/kept"):
        after = {**before, "work/map.npz": "2", name: "3"}
        assert wrongly_written(step, before, after) == [f"{name} was written"]
    assert wrongly_written(step, before, {"work/": "", "work/map.npz": "2"}) == [
        "work/kept is gone"
    ]
    kept = {**before, "work/map.npz": "2", f"home/{CACHE}/entry.npz": "3"}
    assert wrongly_written(step, before, kept) == []
    assert wrongly_written(step, before, kept, cache=False) != []


@pytest.mark.slow
def test_a_network_would_be_seen(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(GUARD), "GUARD_RECORD": str(tmp_path / "record")}
    for attempt in (
        "import socket; socket.create_connection(('127.0.0.1', 9))",
        "import urllib.request as r; r.urlopen('http://127.0.0.1:9')",
        "import socket; socket.gethostbyname('localhost')",
    ):
        done = subprocess.run([sys.executable, "-c", attempt], env=environment, capture_output=True)
        assert b"no network here" in done.stderr
        assert "network" in (tmp_path / "record").read_text(encoding="utf-8")
        (tmp_path / "record").unlink()


def test_a_wheel_holds_every_file_of_the_package() -> None:
    with (PROJECT / "pyproject.toml").open("rb") as file:
        held = tomllib.load(file)["tool"]["setuptools"]["package-data"]["cubicfish_cli"]
    files = [Path(name) for name in project_files(PROJECT) if name.startswith("cubicfish_cli/")]
    other = [path.relative_to("cubicfish_cli").as_posix() for path in files if path.suffix != ".py"]
    assert [name for name in other if not any(fnmatch(name, pattern) for pattern in held)] == []
    assert [pattern for pattern in held if not any(fnmatch(name, pattern) for name in other)] == []
    folders = {path.parent for path in files if path.suffix == ".py"}
    assert [folder for folder in folders if not (PROJECT / folder / "__init__.py").exists()] == []


def test_a_source_distribution_holds_every_file() -> None:
    words = (PROJECT / "MANIFEST.in").read_text(encoding="utf-8").split()
    always = (
        "cubicfish/",
        "cubicfish_cli/",
        "LICENSE",
        "README.md",
        "pyproject.toml",
        "MANIFEST.in",
        ".ci/",
    )
    rest = [name for name in project_files(PROJECT) if not name.startswith((*always, ".git"))]
    assert [name for name in rest if name not in words and name.split("/")[0] not in words] == []


@pytest.mark.slow
def test_what_the_metadata_promise() -> None:
    project = load_project(PROJECT)
    assert project["version"] == package_version(PROJECT)
    oldest = project["requires-python"].removeprefix(">=")
    named = [line.rsplit(" ", 1)[1] for line in project["classifiers"] if "Python :: 3." in line]
    assert named[0] == oldest
    assert named == sorted(named, key=lambda name: int(name.split(".")[1]))
    assert f"py{oldest.replace('.', '')}" in (PROJECT / "pyproject.toml").read_text()
    # Each library that the code imports is asked for, and the other way round.
    options = {re.split(r"[=<>\[]", pin)[0].lower() for pin in lower_bounds(project)}
    names = {"cv2": "opencv-python-headless", "yaml": "pyyaml", "mpl_toolkits": "matplotlib",
             "pillow_heif": "pillow-heif"}  # fmt: skip
    used = {names.get(name, name.lower()) for name in imported_libraries()}
    assert used == options


def imported_libraries() -> set[str]:
    """The libraries that the package imports anywhere, and those they are useless without."""
    found = set()
    for path in PROJECT.glob("cubicfish*/**/*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add((node.module or "").split(".")[0])
    return found - sys.stdlib_module_names - {"cubicfish", "cubicfish_cli"}
