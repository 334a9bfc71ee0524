"""Imports go only downwards: what each part of the package may import, read from its source."""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cubicfish_cli

PACKAGE = Path(cubicfish_cli.__file__).parent

# Utilities: whatever stands below them in ARCHITECTURE.md may import them.
FOR_ALL = {"errors", "types", "units", "angles", "geometry", "threads", "wording"}
# Part -> what else it may import directly. A part may import itself, too.
ALLOWED: dict[str, set[str]] = {
    **{part: set() for part in FOR_ALL},
    "extension": set(),
    "words": {"extension"},
    "listener": {"words"},
    "arrays": set(),
    "files": set(),
    "reading": set(),
    "plain_yaml": {"reading"},
    "tables": {"reading"},
    "boards": set(),
    "target": {"plain_yaml", "boards"},
    "mosaic": set(),
    "picture_headers": set(),
    "frame_names": set(),
    "photos": {"files", "mosaic", "picture_headers"},
    "films": {"files", "frame_names", "photos"},
    "executors": {"files", "photos"},
    "detection": {
        "words",
        "files",
        "boards",
        "target",
        "mosaic",
        "picture_headers",
        "photos",
        "executors",
    },
    "observations": {"arrays", "boards", "target"},
    "placement": {"target", "observations"},
    "corner_files": {"files", "reading", "tables", "boards", "target", "observations"},
    "lenses": set(),
    "assess": {"words", "frame_names", "boards", "target", "observations", "lenses"},
    "formats": {"files", "reading", "plain_yaml", "boards", "target", "lenses", "assess"},
    "fitting": {
        "words",
        "boards",
        "target",
        "frame_names",
        "observations",
        "placement",
        "lenses",
        "assess",
        "formats",
    },
    "identification": {
        "words",
        "boards",
        "target",
        "photos",
        "executors",
        "detection",
        "observations",
        "placement",
        "lenses",
        "fitting",
    },
    "diagnosis": {
        "words",
        "assess",
        "boards",
        "target",
        "photos",
        "detection",
        "observations",
        "placement",
        "lenses",
        "fitting",
        "identification",
    },
    "overlay": {
        "words",
        "boards",
        "target",
        "photos",
        "detection",
        "observations",
        "identification",
    },
    "undistortion": {"files", "picture_headers", "photos", "films", "executors", "lenses"},
    "rendering": {"tables", "boards", "target", "lenses"},
    "printing": {"boards", "target", "lenses"},
    "advice": {
        "words",
        "boards",
        "target",
        "observations",
        "lenses",
        "assess",
        "fitting",
        "rendering",
        "printing",
    },
}
ALLOWED["report"] = {*ALLOWED}
ALLOWED["library"] = {*ALLOWED}
ALLOWED["cli"] = {*ALLOWED}
ALLOWED["commands"] = {*ALLOWED}
ALLOWED["extensions"] = {*ALLOWED}
ALLOWED["__main__"] = {"cli"}
# What it offers when it is asked.
ALLOWED["__init__"] = {*ALLOWED} - {
    "cli",
    "commands",
    "extensions",
    "report",
    "__main__",
}

# Parts that do not even load numpy, so that `--help` answers at once.
LIGHT = {
    "__init__", "errors", "wording", "files", "reading", "plain_yaml", "picture_headers",
    "frame_names",
}  # fmt: skip

ROOT = Path(__file__).parents[2]
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
# Part -> its libraries beside numpy, from top to bottom, as ARCHITECTURE.md lists them.
PARTS = {
    part: {*libraries.split(", ")} - {""}
    for part, libraries in re.findall(
        r"^  (\w+)(?:\.py|/) .*?(?:\(([\w, ]+)\))?$",
        ARCHITECTURE.partition("```\ncubicfish_cli/\n")[2].partition("```")[0],
        re.MULTILINE,
    )
}


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


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


def above(part: str) -> set[str]:
    """What stands above a part in ARCHITECTURE.md; the package's own two files stand below all."""
    order = [*PARTS]
    return {*order[: order.index(part)]} if part in PARTS else {*order}


@cache
def all_imported() -> dict[Path, set[str]]:
    """What each file imports: read when a test asks, not while tests are collected."""
    return {path: imported(path) for path in sorted(PACKAGE.rglob("*.py"))}


def test_a_module_imports_only_what_stands_above_it() -> None:
    for path, names in all_imported().items():
        part = part_of(path)
        assert part in ALLOWED, f"{part} has no place in the layers: give it one here"
        parts = {full.split(".")[1] for full in names if full.startswith("cubicfish_cli.")}
        assert parts - {"__version__", part} <= (ALLOWED[part] | FOR_ALL) & above(part), path


def test_libraries_stay_in_the_parts_that_need_them() -> None:
    found: dict[str, set[str]] = {part: set() for part in PARTS}
    for path, names in all_imported().items():
        libraries = {full.split(".")[0] for full in names} - sys.stdlib_module_names
        assert "numpy" not in libraries or part_of(path) not in LIGHT, path
        found.setdefault(part_of(path), set()).update(libraries - {"cubicfish_cli", "numpy"})
    assert found == {**PARTS, "__init__": set(), "__main__": set()}


# What commands take of the package beside one call of a public name: names resolved, words read.
RESOLVING = {
    "as_text", "check_inputs", "connect", "extension_commands", "in_folder",
    "length_mm", "load_place", "parse_size",
    "read_bytes",
}  # fmt: skip
PRINTING = {
    "ErrorStatistics",
    "counted",
    "distances_words",
    "missing",
    "photo_verdicts",
    "print_size",
    "read_record",
}
WORDS = {"identification", "wording", "words"}


def test_what_commands_call_is_public() -> None:
    allowed = {*cubicfish_cli.__all__, *RESOLVING, *PRINTING}
    for path in sorted((PACKAGE / "cli").glob("*.py")):
        taken = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("cubicfish_cli."):
                parts = str(node.module).split(".")[1:]
                if "cli" not in parts and not WORDS & set(parts):
                    taken |= {alias.name for alias in node.names if alias.name.islower()}
        assert taken <= allowed, path


def test_packages_import_nothing_by_themselves() -> None:
    packages = {
        path: names
        for path, names in all_imported().items()
        if path.stem == "__init__" and path.parent != PACKAGE
    }
    assert len(packages) > 10
    assert {path: names for path, names in packages.items() if names} == {}


def test_the_package_itself_imports_nothing_until_it_is_asked() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    at_once = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in at_once] == []


def test_the_layers_only_go_down() -> None:
    assert {*ALLOWED} == {*PARTS, "__init__", "__main__"}
    for part, allowed in ALLOWED.items():
        assert allowed <= above(part), part


def test_the_architecture_names_modules_that_are_there() -> None:
    pages = [ARCHITECTURE, (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")]
    for package in PACKAGE.rglob("__init__.py"):  # each says how its part works
        pages.append(ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) or "")
    named = {name for page in pages for name in re.findall(r"`([\w/]+\.py)`", page)}
    folders = ("cubicfish_cli", "tests", "docs", "benchmarks")
    there = [path.as_posix() for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(named) > 100
    assert [one for one in sorted(named) if not any(p.endswith(f"/{one}") for p in there)] == []
