"""Every option reaches the library, or is read by its command: none is taken and forgotten."""

import ast
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from cubicfish_cli.app import terminal as cli

MODULES = [
    import_module(f"{cli.__name__}.{path.stem}") for path in Path(cli.__path__[0]).glob("[a-z]*.py")
]
HOW = {"jobs", "no_cache", "overwrite", "scheduler"}  # what a ``Run`` is made of


def _records(module: ModuleType) -> Iterator[type]:
    for one in vars(module).values():
        if isinstance(one, type) and hasattr(one, "options") and one.__module__ == module.__name__:
            yield one


def _fields(kind: type, module: ModuleType) -> Iterator[tuple[str, ModuleType]]:
    """The fields of a record and of the records in it, and where those stand."""
    for name, annotation in kind.__annotations__.items():
        inner = vars(module).get(annotation)
        if hasattr(inner, "options"):
            yield from _fields(inner, import_module(inner.__module__))
        else:
            yield name, module


def _parameters(tree: ast.Module) -> set[str]:
    """Those of the functions of the library that a module hands to ``call``."""
    modules = {
        name.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    called = {
        node.args[0].id
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "call"
    }
    functions = [getattr(import_module(modules[name]), name) for name in called]
    return {name for one in functions for name in inspect.signature(one).parameters}


def _read(module: ModuleType) -> set[str]:
    tree = ast.parse(inspect.getsource(module))
    return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


@pytest.mark.parametrize(
    ("kind", "module"),
    [
        pytest.param(kind, module, id=f"{module.__name__}.{kind.__name__}")
        for module in MODULES
        for kind in _records(module)
        if kind.__name__.startswith(("Asked", "Print"))
    ],
)
def test_no_option_is_forgotten(kind: type, module: ModuleType) -> None:
    parameters = _parameters(ast.parse(inspect.getsource(module)))
    taken = parameters | _read(module) | (HOW if parameters else set())
    forgotten = [
        name
        for name, of in _fields(kind, module)
        if name not in taken and (of is module or name not in _read(of))
    ]
    assert not forgotten
