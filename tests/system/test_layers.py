"""Imports go only upwards: what each part of the packages may import, read from their source."""

import ast
import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

from cubicfish_cli.extension_table import TABLE

# Modules that do not even load numpy, so that `--help` answers at once.
LIGHT = {
    "cubicfish/__init__", "cubicfish/lazy", "cubicfish/errors", "cubicfish/wording",
    "cubicfish/files/whole_files", "cubicfish/files/reading", "cubicfish/files/plain_yaml",
    "cubicfish/files/frame_names", "cubicfish/arguments", "cubicfish_cli/__init__",
    "cubicfish_cli/core_table", "cubicfish_cli/extension_guard", "cubicfish_cli/extension_table",
}  # fmt: skip

ROOT = Path(__file__).parents[2]
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
PACKAGES = ("cubicfish", "cubicfish_cli")
GROUPS = ("cubicfish", "cubicfish_cli", "cubicfish_cli/extensions")


def listed_parts() -> dict[str, set[str]]:
    """Part -> its libraries beside numpy, from top to bottom, as ARCHITECTURE.md lists them."""
    parts: dict[str, set[str]] = {}
    above: list[str] = []
    block = ARCHITECTURE.partition("```\n")[2].partition("sample_data/")[0]
    for line in block.splitlines():
        found = re.match(r"( *)(\w+)(?:\.py|/) .*?(?:\(([\w, ]+)\))?$", line)
        if found is None:
            continue
        indent, name, libraries = found.groups()
        above[len(indent) // 2 :] = [name]
        if (part := "/".join(above)) not in GROUPS:
            parts[part] = {*(libraries or "").split(", ")} - {""}
    return parts


PARTS = listed_parts()
ORDER = [*PARTS]


def part_of(name: str) -> str:
    """The part that a module belongs to, by its path or its dotted name."""
    steps = re.split(r"[./]", name.removesuffix(".py").removesuffix("/__init__"))
    for number in range(1, len(steps)):
        if "/".join(steps[:number]) not in GROUPS:
            return "/".join(steps[:number])
    return "/".join(steps)


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below a node: expressions, which hold most of the nodes, hold no imports."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for one in getattr(node, part, ()):
            yield one
            yield from statements(one)


def imported(path: Path) -> set[str]:
    """Full names of the modules that a file imports anywhere, inside functions too."""
    names: set[str] = set()
    for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import: write the full name"
            module = node.module or ""
            if module in PACKAGES:
                names.update(f"{module}.{alias.name}" for alias in node.names)
            else:
                names.add(module)
    return names


@cache
def all_imported() -> dict[str, set[str]]:
    """What each file imports: read when a test asks, not while tests are collected."""
    return {
        path.relative_to(ROOT).as_posix(): imported(path)
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def needs_of(extension: str) -> Sequence[str]:
    """The other extensions that an extension says it needs."""
    return resolve_name(TABLE[extension]).needs


def breaks(file: str, module: str) -> bool:
    """Whether a file may not import a module of the package."""
    own, other = part_of(file), part_of(module)
    if other not in ORDER or own not in ORDER or own == other:
        return False
    if all(part.startswith("cubicfish_cli/extensions/") for part in (own, other)):
        return Path(other).name not in needs_of(Path(own).name)
    return ORDER.index(other) > ORDER.index(own)


def test_a_module_imports_only_what_stands_above_it() -> None:
    wrong: dict[str, set[str]] = {}
    for file, names in all_imported().items():
        assert part_of(file) in {*PARTS, *GROUPS, "cubicfish_cli/__main__"}, file
        inside = {full for full in names if full.split(".")[0] in PACKAGES}
        below = {module for module in inside if breaks(file, module)}
        if below:
            wrong[file] = below
    assert wrong == {}


def test_an_extension_needs_what_it_says() -> None:
    for name in TABLE:
        folder = f"cubicfish_cli/extensions/{name}"
        used = {
            Path(part_of(module)).name
            for file, names in all_imported().items()
            if part_of(file) == folder
            for module in names
            if module.startswith("cubicfish_cli.extensions.") and part_of(module) != folder
        }
        assert used == {*needs_of(name)}


def test_every_part_is_there() -> None:
    there = {part_of(file) for file in all_imported()} - {*GROUPS}
    assert there == {*PARTS, "cubicfish_cli/__main__"}


def test_libraries_stay_in_the_parts_that_need_them() -> None:
    found: dict[str, set[str]] = {part: set() for part in PARTS}
    for file, names in all_imported().items():
        libraries = {full.split(".")[0] for full in names} - sys.stdlib_module_names
        assert "numpy" not in libraries or file.removesuffix(".py") not in LIGHT, file
        found.setdefault(part_of(file), set()).update(libraries - {*PACKAGES, "numpy"})
    assert {part: libraries for part, libraries in found.items() if part in PARTS} == PARTS
    assert not any(found[part] for part in {*found} - {*PARTS})


def test_packages_import_nothing_by_themselves() -> None:
    packages = {
        file: names
        - {"cubicfish.lazy", "cubicfish.lazy_names"}  # by which a face is loaded when it is asked
        for file, names in all_imported().items()
        if file.endswith("/__init__.py")
    }
    assert len(packages) > 20
    assert {file: names for file, names in packages.items() if names} == {}


def test_the_architecture_names_modules_that_are_there() -> None:
    pages = [ARCHITECTURE, (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")]
    for package in ROOT.glob("cubicfish*/**/__init__.py"):  # each says how its part works
        pages.append(ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) or "")
    named = {name for page in pages for name in re.findall(r"`([\w/]+\.py)`", page)}
    folders = (*PACKAGES, "tests", "docs", "benchmarks")
    there = [path.as_posix() for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(named) > 100
    assert [one for one in sorted(named) if not any(p.endswith(f"/{one}") for p in there)] == []


def test_tests_of_the_library_need_no_program() -> None:
    """They run where it is not installed, with what they share; those of sentences are its own."""
    tests = ROOT / "tests"
    support = {path.stem: path for path in (tests / "support").glob("*.py")}
    waiting = [*(tests / "cubicfish").rglob("*.py"), tests / "conftest.py"]
    seen: set[Path] = set()
    wrong = set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        names = imported(path)
        waiting += [support[name] for name in names & support.keys()]
        if any(name.split(".")[0] == "cubicfish_cli" for name in names):
            wrong.add(path.relative_to(ROOT).as_posix())
    assert len(seen) > 100
    assert wrong == set()
