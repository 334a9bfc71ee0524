"""The face of the library: what it offers, and that everything outside it takes nothing else."""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OUTSIDE = ("cubicfish_cli", "benchmarks", "docs")  # the program and its extensions are the first
PACKAGES = ("cubicfish", *sorted(
    f"cubicfish.{path.parent.name}" for path in (ROOT / "cubicfish").glob("*/__init__.py")
))  # fmt: skip

MOST_NAMES = 124
MOST_INTERNAL = 0  # never more than this: lower it with every name that is no longer taken
# Full name -> why it is taken all the same; at most ten.
EXCEPTIONS: dict[str, str] = {
    "cubicfish.arguments.refuse_misfit": "records of the program are held as arguments are",
    "cubicfish.find.detection.finder": "benchmarks/detection.py counts the patches that it grows",
    "cubicfish.lazy.lazy_names": "the program's own names are loaded in the same way",
    "cubicfish.photos.photos.one_opencv_thread": "a state of the process, which can be one alone",
    "cubicfish.threads.one_blas_thread": "a state of the process, which can be one alone",
    "cubicfish.models.lift.lift": "the paper's sums are repeated, and spelt in other languages",
    "cubicfish.fit.point_fit.fit_ratio": "benchmarks/paper.py repeats the paper's own fit",
    "cubicfish.files.whole_files.remove_orphans": "workers that died far away left some",
    "cubicfish.geometry.outermost": "frames of films are told apart by it, as photos of a fit are",
    "cubicfish.target.placement.best_named": "a page names corners as the fit did that it shows",
}


def imports_of(text: str) -> Iterator[tuple[str, str]]:
    """(module, name) of all that source text imports; name is empty where it is the module."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            yield from ((node.module or "", alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)


def is_internal(module: str, name: str) -> bool:
    """Whether an import looks past the face."""
    if module.split(".")[0] != "cubicfish":
        return False
    if not name:
        return module not in PACKAGES
    return module not in PACKAGES or name not in offered(module)


@cache
def offered(package: str) -> dict[str, str]:
    """Name -> the module that defines it, of a package, as its stub has them."""
    stub = ROOT / package.replace(".", "/") / "__init__.pyi"
    nodes = ast.parse(stub.read_text(encoding="utf-8")).body
    return {
        str(alias.asname): str(node.module)
        for node in nodes
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def blocks_of(page: Path) -> Iterator[str]:
    """The Python blocks of a page."""
    yield from re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE)


def internal_names() -> dict[str, set[str]]:
    """Full name that is taken from inside the library -> who takes it."""
    texts = [
        (path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
        for folder in OUTSIDE
        for path in (ROOT / folder).rglob("*.py")
    ]
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    texts += [(page.name, block) for page in pages for block in blocks_of(page)]
    found: dict[str, set[str]] = {}
    for file, text in texts:
        for module, name in imports_of(text):
            if is_internal(module, name):
                found.setdefault(f"{module}.{name}".rstrip("."), set()).add(file)
    return found


def test_an_import_past_the_face_is_known() -> None:
    text = """
import cubicfish
import cubicfish.models.cubic
from cubicfish import Target, cubic_camera
def later():
    from cubicfish.models import Lens, radial
    from cubicfish.models.radial import RadialCamera
    from cubicfish_cli.terminal import main
"""
    assert {one for one in imports_of(text) if is_internal(*one)} == {
        ("cubicfish.models.cubic", ""),
        ("cubicfish", "cubic_camera"),
        ("cubicfish.models", "radial"),
        ("cubicfish.models.radial", "RadialCamera"),
    }


def test_ever_fewer_internal_names_are_taken() -> None:
    found = internal_names()
    assert {*EXCEPTIONS} <= {*found}
    assert len(EXCEPTIONS) <= 10
    assert all(EXCEPTIONS.values())
    left = {name: files for name, files in found.items() if name not in EXCEPTIONS}
    assert len(left) <= MOST_INTERNAL, left


def test_the_face_is_narrow() -> None:
    names = [name for package in PACKAGES for name in offered(package)]
    assert 40 < len(names) <= MOST_NAMES
    assert sorted({name for name in names if names.count(name) > 1}) == []  # one place each


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_offers_what_its_stub_says(package: str) -> None:
    face, folder = importlib.import_module(package), ROOT / package.replace(".", "/")
    assert face.__all__ == sorted(offered(package))
    modules = {path.stem for path in folder.glob("*.py")}
    modules |= {path.parent.name for path in folder.glob("*/__init__.py")}
    # An import of the module would put it in the place of the name.
    assert modules & {*face.__all__} == set()
    assert {*face.__all__} <= {*dir(face)}
    for name in face.__all__:
        thing = getattr(face, name)
        defined = getattr(importlib.import_module(offered(package)[name]), name)
        assert inspect.unwrap(thing) is inspect.unwrap(defined)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert inspect.getdoc(thing), name
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nonsense'"):
        _ = face.nonsense


def test_the_library_itself_goes_past_its_face() -> None:
    """So its parts may be loaded in any order, and test_layers.py sees what they need."""
    by_face = {
        f"{path.relative_to(ROOT)}: {module}.{name}"
        for path in (ROOT / "cubicfish").rglob("*.py")
        for module, name in imports_of(path.read_text(encoding="utf-8"))
        if module in PACKAGES and name in offered(module)
    }
    assert by_face == set()


def test_every_name_is_on_the_page_of_the_library() -> None:
    page = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    section = page.partition("## All names of the library\n")[2].partition("\n## ")[0]
    tables = dict(
        re.findall(r"^### `([\w.]+)`\n(.*?)(?=^###|\Z)", section, re.DOTALL | re.MULTILINE)
    )
    assert {*tables} == {package for package in PACKAGES if offered(package)}
    for package, table in tables.items():
        cells = re.findall(r"^\| (`.*?) \| .+ \|$", table, re.MULTILINE)
        assert sorted(re.findall(r"`(\w+)`", " ".join(cells))) == sorted(offered(package))
