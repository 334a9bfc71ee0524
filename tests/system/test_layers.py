"""Imports go only downwards: what each part of the package may import, read from its source."""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cubicfish_cli

PACKAGE = Path(cubicfish_cli.__file__).parent

# Parts that do not even load numpy, so that `--help` answers at once.
LIGHT = {
    "__init__", "core/errors", "core/wording", "core/files", "core/reading", "core/plain_yaml",
    "core/frame_names", "app/extensions",
}  # fmt: skip

ROOT = Path(__file__).parents[2]
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
GROUPS = ("core", "corners", "app", "extensions")


def listed_parts() -> dict[str, set[str]]:
    """Part -> its libraries beside numpy, from top to bottom, as ARCHITECTURE.md lists them."""
    parts, group = {}, ""
    block = ARCHITECTURE.partition("```\ncubicfish_cli/\n")[2].partition("```")[0]
    for line in block.splitlines():
        found = re.match(r"(  |    )(\w+)(?:\.py|/) .*?(?:\(([\w, ]+)\))?$", line)
        if found is None:
            continue
        indent, name, libraries = found.groups()
        if len(indent) == 2:
            group = name
            if name in GROUPS:
                continue
        part = f"{group}/{name}" if len(indent) == 4 else name
        parts[part] = {*(libraries or "").split(", ")} - {""}
    return parts


PARTS = listed_parts()
ORDER = [*PARTS]


def part_of(name: str) -> str:
    """The part that a module belongs to, by its path or its dotted name below the package."""
    first, *rest = re.split(r"[./]", name.removesuffix(".py").removesuffix("/__init__"))
    return f"{first}/{rest[0]}" if first in GROUPS and rest else first


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
            if module == "cubicfish_cli":
                names.update(f"{module}.{alias.name}" for alias in node.names)
            else:
                names.add(module)
    return names


@cache
def all_imported() -> dict[str, set[str]]:
    """What each file imports: read when a test asks, not while tests are collected."""
    return {
        path.relative_to(PACKAGE).as_posix(): imported(path)
        for path in sorted(PACKAGE.rglob("*.py"))
    }


def breaks(file: str, module: str) -> bool:
    """Whether a file may not import a module of the package."""
    own, other = part_of(file), part_of(module)
    if other not in ORDER or own not in ORDER or own == other:
        return False
    if own.startswith("extensions/") and other.startswith("extensions/"):
        return True
    return ORDER.index(other) > ORDER.index(own)


def test_a_module_imports_only_what_stands_above_it() -> None:
    wrong: dict[str, set[str]] = {}
    for file, names in all_imported().items():
        assert part_of(file) in {*PARTS, *GROUPS, "__init__", "__main__"}, file
        inside = {full.partition(".")[2] for full in names if full.startswith("cubicfish_cli.")}
        below = {module for module in inside if breaks(file, module)}
        if below:
            wrong[file] = below
    assert wrong == {}


def test_every_part_is_there() -> None:
    there = {part_of(file) for file in all_imported()} - {*GROUPS}
    assert there == {*PARTS, "__init__", "__main__"}


def test_libraries_stay_in_the_parts_that_need_them() -> None:
    found: dict[str, set[str]] = {part: set() for part in PARTS}
    for file, names in all_imported().items():
        libraries = {full.split(".")[0] for full in names} - sys.stdlib_module_names
        part = part_of(file)
        assert "numpy" not in libraries or part not in LIGHT, file
        found.setdefault(part, set()).update(libraries - {"cubicfish_cli", "numpy"})
    assert {part: libraries for part, libraries in found.items() if part in PARTS} == PARTS
    assert not any(found[part] for part in {*found} - {*PARTS})


def test_packages_import_nothing_by_themselves() -> None:
    packages = {
        file: names for file, names in all_imported().items() if file.endswith("/__init__.py")
    }
    assert len(packages) > 10
    assert {file: names for file, names in packages.items() if names} == {}


def test_the_package_itself_imports_nothing_until_it_is_asked() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    at_once = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in at_once] == []


def test_the_architecture_names_modules_that_are_there() -> None:
    pages = [ARCHITECTURE, (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")]
    for package in PACKAGE.rglob("__init__.py"):  # each says how its part works
        pages.append(ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) or "")
    named = {name for page in pages for name in re.findall(r"`([\w/]+\.py)`", page)}
    folders = ("cubicfish_cli", "tests", "docs", "benchmarks")
    there = [path.as_posix() for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(named) > 100
    assert [one for one in sorted(named) if not any(p.endswith(f"/{one}") for p in there)] == []
