"""Imports go only downwards: what each part of the package may import, read from its source."""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cubicfish_cli

PACKAGE = Path(cubicfish_cli.__file__).parent

# Part -> what it may import directly; a part also may import itself. Read from top to bottom,
# this is the flow of the data: nothing imports a part that stands below it.
ALLOWED: dict[str, set[str]] = {
    "errors": set(),
    "types": set(),
    "wording": set(),
    "words": set(),
    "listener": {"words"},
    "angles": set(),
    "units": set(),
    "geometry": set(),
    "arrays": {"errors", "wording"},
    "files": {"errors"},
    "reading": {"errors"},
    "plain_yaml": {"errors", "reading", "wording"},
    "tables": {"errors", "reading", "wording"},
    "boards": {"errors", "wording"},
    "target": {"errors", "boards", "plain_yaml", "wording"},
    "picture_headers": set(),
    "frame_names": set(),
    "photos": {"errors", "files", "wording", "picture_headers"},
    "films": {"errors", "files", "frame_names", "photos", "wording"},
    "executors": {"errors", "files", "photos"},
    "detection": {
        "errors",
        "angles",
        "files",
        "photos",
        "executors",
        "target",
        "boards",
        "words",
    },
    "observations": {"errors", "wording", "arrays", "target", "boards"},
    "placement": {"geometry", "observations", "target"},
    "corner_files": {
        "errors",
        "files",
        "reading",
        "tables",
        "target",
        "boards",
        "observations",
        "wording",
    },
    "lenses": {"errors", "angles", "geometry", "units"},
    "assess": {"errors", "angles", "frame_names", "lenses", "units", "words"},
    "formats": {
        "errors",
        "files",
        "reading",
        "plain_yaml",
        "target",
        "boards",
        "lenses",
        "assess",
        "wording",
    },
    "fitting": {
        "errors",
        "angles",
        "wording",
        "geometry",
        "target",
        "boards",
        "observations",
        "placement",
        "frame_names",
        "lenses",
        "assess",
        "formats",
        "words",
    },
    "identification": {
        "errors",
        "geometry",
        "executors",
        "photos",
        "target",
        "boards",
        "detection",
        "observations",
        "placement",
        "lenses",
        "fitting",
        "words",
    },
    "diagnosis": {
        "errors",
        "geometry",
        "photos",
        "target",
        "boards",
        "detection",
        "observations",
        "placement",
        "lenses",
        "fitting",
        "identification",
        "words",
    },
    "overlay": {
        "photos",
        "target",
        "boards",
        "detection",
        "observations",
        "identification",
        "words",
    },
    "undistortion": {
        "errors",
        "angles",
        "executors",
        "files",
        "photos",
        "picture_headers",
        "films",
        "lenses",
        "wording",
    },
    "rendering": {
        "units",
        "errors",
        "angles",
        "lenses",
        "plain_yaml",
        "tables",
        "target",
        "boards",
        "wording",
        "observations",
    },
    "printing": {
        "errors",
        "files",
        "wording",
        "words",
        "target",
        "boards",
        "formats",
        "rendering",
        "units",
    },
    "advice": {
        "errors",
        "angles",
        "target",
        "boards",
        "observations",
        "lenses",
        "assess",
        "fitting",
        "rendering",
        "units",
        "words",
    },
}
ALLOWED["report"] = {*ALLOWED}
ALLOWED["library"] = {*ALLOWED}
ALLOWED["cli"] = {*ALLOWED}
ALLOWED["__main__"] = {"cli"}
ALLOWED["__init__"] = {*ALLOWED} - {"cli", "report", "__main__"}  # what it offers when it is asked

# Libraries that only some parts may import. numpy is left out of what `--help` loads by
# test_cli_main.py, since importing it lazily is enough there.
CONFINED: dict[str, set[str]] = {
    "cv2": {
        "boards",
        "executors",
        "photos",
        "films",
        "detection",
        "overlay",
        "undistortion",
        "rendering",
    },
    "scipy": {*ALLOWED} - {"__init__", "__main__", "cli", "errors", "wording", "files"},
    "av": {"films", "undistortion"},
    "rosbags": {"films"},
    "OpenEXR": {"undistortion"},
    "click": {"cli"},
    "rich": {"cli"},
    "platformdirs": {"cli"},
    "yaml": {"plain_yaml"},
    "matplotlib": {"printing", "report"},
    "jinja2": {"report"},
    "dask": {"executors"},
    "distributed": {"executors"},
    "numpy": {*ALLOWED}
    - {
        "__init__",
        "errors",
        "wording",
        "files",
        "reading",
        "plain_yaml",
        "picture_headers",
        "frame_names",
    },
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


@cache
def all_imported() -> dict[Path, set[str]]:
    """What each file imports: read when a test asks, not while tests are collected."""
    return {path: imported(path) for path in sorted(PACKAGE.rglob("*.py"))}


def test_a_module_imports_only_what_stands_above_it() -> None:
    for path, names in all_imported().items():
        part = part_of(path)
        assert part in ALLOWED, f"{part} has no place in the layers: give it one here"
        parts = {full.split(".")[1] for full in names if full.startswith("cubicfish_cli.")}
        assert parts - {"__version__", "types"} <= ALLOWED[part] | {part}, path


def test_libraries_stay_in_the_parts_that_need_them() -> None:
    for path, names in all_imported().items():
        libraries = {full.split(".")[0] for full in names} - sys.stdlib_module_names
        libraries -= {"cubicfish_cli"}
        assert libraries <= set(CONFINED), f"{path}: declare it here and in pyproject.toml"
        misplaced = {one for one in libraries if part_of(path) not in CONFINED[one]}
        assert not misplaced, path


# What commands take of the package beside one call of a public name: names resolved, words read.
RESOLVING = {
    "as_text", "check_inputs", "connect", "in_folder", "length_mm", "parse_crop", "parse_size",
    "read_bytes", "rig_in",
}  # fmt: skip
PRINTING = {
    "counted",
    "distances_words",
    "missing",
    "photo_verdicts",
    "print_size",
    "recorded_uncertainty",
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
    above: set[str] = set()
    for part, allowed in ALLOWED.items():
        assert allowed <= above, part
        above.add(part)


def test_the_architecture_names_modules_that_are_there() -> None:
    root = Path(__file__).parents[2]
    text = (root / "ARCHITECTURE.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w/]+\.py)`", text))
    folders = ("cubicfish_cli", "tests", "docs", "benchmarks")
    there = [path.as_posix() for folder in folders for path in (root / folder).rglob("*.py")]
    assert len(named) > 100
    assert [one for one in sorted(named) if not any(p.endswith(f"/{one}") for p in there)] == []
