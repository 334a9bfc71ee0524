"""What a wheel and a source distribution must hold, and what they must say of themselves."""

from __future__ import annotations

import re
import shutil
import subprocess
import tarfile
import tomllib
import zipfile
from collections.abc import Iterable, Mapping
from email.message import Message
from email.parser import Parser
from pathlib import Path
from typing import Any

PROJECT = Path(__file__).parents[3]
# What a checkout may hold besides: environments, caches, what was built before.
_LEFT_OUT = re.compile(
    r"(^|/)(\.git|\.?venv[^/]*|build|dist|[^/]*\.egg-info|__pycache__|\.[a-z]+_cache|\.hypothesis"
    r"|\.benchmarks|(sample_)?calibration)(/|$)|\.py[cod]$"
)
# Only of use in the repository.
_REPOSITORY_ONLY = re.compile(r"^(\.ci/|\.git)")


def project_files(root: Path) -> list[str]:
    """The files of a checkout or of an unpacked source distribution, by their path in it."""
    if (root / ".git").exists() and shutil.which("git"):
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=root, capture_output=True, text=True, check=True,
        )  # fmt: skip
        names = {name for name in listed.stdout.split("\0") if (root / name).is_file()}
    else:
        names = {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}
    return sorted(name for name in names if not _LEFT_OUT.search(name))


def wheel_problems(wheel: Path, root: Path) -> list[str]:
    """What is wrong with a wheel of the project in ``root``, a line each."""
    with zipfile.ZipFile(wheel) as archive:
        held = [name for name in archive.namelist() if not name.endswith("/")]
        about = next(name.split("/")[0] for name in held if ".dist-info/" in name)
        metadata = Parser().parsestr(archive.read(f"{about}/METADATA").decode())
        entries = archive.read(f"{about}/entry_points.txt").decode()
        pure = "py3-none-any" in archive.read(f"{about}/WHEEL").decode()
    wanted = [
        name for name in project_files(root) if name.startswith(("cubicfish/", "cubicfish_cli/"))
    ]
    code = [name for name in held if not name.startswith(about + "/")]
    wrong = _differences(wanted, code, "the wheel")
    if f"{about}/licenses/LICENSE" not in held:
        wrong.append("the wheel has no LICENSE")
    if "cubicfish = cubicfish_cli.terminal.start:main" not in entries:
        wrong.append("the wheel installs no program cubicfish")
    if not pure:
        wrong.append("the wheel is not for every machine")
    return wrong + metadata_problems(metadata, root)


def sdist_problems(sdist: Path, root: Path) -> list[str]:
    """What is wrong with a source distribution of the project in ``root``, a line each."""
    with tarfile.open(sdist) as archive:
        held = [member.name.split("/", 1)[-1] for member in archive if member.isfile()]
    wanted = [name for name in project_files(root) if not _REPOSITORY_ONLY.match(name)]
    made = re.compile(r"^(PKG-INFO|setup\.cfg|[^/]*\.egg-info/.*)$")
    return _differences(
        wanted, [name for name in held if not made.match(name)], "the source distribution"
    )


def _differences(wanted: Iterable[str], held: Iterable[str], where: str) -> list[str]:
    wanted, held = set(wanted), set(held)
    return [f"{name} is not in {where}" for name in sorted(wanted - held)] + [
        f"{name} is in {where}, and should not be" for name in sorted(held - wanted)
    ]


def metadata_problems(metadata: Message, root: Path) -> list[str]:
    """What is wrong with what a distribution says of itself, a line each."""
    project = load_project(root)
    wrong = []
    single = {
        "Name": project["name"],
        "Version": package_version(root),
        "Summary": project["description"],
        "Requires-Python": project["requires-python"],
        "License-Expression": "MIT",
        "License-File": "LICENSE",
        "Description-Content-Type": "text/markdown",
    }
    wrong += [
        f"{key} is {metadata[key]!r}, not {value!r}"
        for key, value in single.items()
        if metadata[key] != value
    ]
    if metadata.get_payload() != (root / "README.md").read_text(encoding="utf-8"):
        wrong.append("the description is not README.md")
    extras = set(metadata.get_all("Provides-Extra") or ())
    if extras != set(project["optional-dependencies"]):
        wrong.append(f"the extras are {sorted(extras)}")
    return wrong


def load_project(root: Path) -> Mapping[str, Any]:
    """The table ``project`` of pyproject.toml."""
    with (root / "pyproject.toml").open("rb") as file:
        project: Mapping[str, Any] = tomllib.load(file)["project"]
    return project


def package_version(root: Path) -> str:
    """What ``cubicfish --version`` says."""
    text = (root / "cubicfish_cli" / "__init__.py").read_text(encoding="utf-8")
    return re.findall(r'^__version__ = "(.+)"$', text, re.MULTILINE)[0]


def lower_bounds(project: Mapping[str, Any]) -> list[str]:
    """The oldest of every library that is promised to do, as pip is told it."""
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"]]
    for name, libraries in extras.items():
        if name not in ("all", "test", "dev", "docs"):
            wanted += libraries
    pins = []
    for line in wanted:
        name, bound = re.match(r"([A-Za-z0-9-]+)>=([0-9.]+)", line).groups()  # type: ignore[union-attr]
        # The last patch of a two-part bound: 1.26 is tried as 1.26.*, 4.10.0.84 as itself.
        pins.append(f"{name}=={bound}" + (".*" if bound.count(".") < 2 else ""))
    return pins
