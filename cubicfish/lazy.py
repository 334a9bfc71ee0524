"""Names that a package offers, each loaded when it is first used.

A package's `__init__.pyi` says which names it offers and where each is defined. It is the one list:
type checkers read it, and so does this module, when the package is first asked for a name. So
nothing is loaded before it is needed, modules may import each other in any order, and what a type
checker sees is what is there.
"""

from __future__ import annotations

import sys

TYPE_CHECKING = (
    False  # what typing has is loaded later: nothing is, while Ctrl-C ends in a traceback
)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def lazy_names(
    package: str, *, checked: bool = False
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Make ``__getattr__`` and ``__dir__`` of a package whose ``__init__.pyi`` lists its names.

    Args:
        package: its ``__name__``. Each line of its stub that says ``from a.module import Name as
            Name`` offers a name; ``__all__`` has them all.
        checked: whether its functions refuse arguments that are not what their annotations say.

    Returns:
        The two functions, for the package to assign. The first raises ``AttributeError`` for names
        that are not offered.

    """
    places: dict[str, str] = {}

    def load(name: str) -> object:
        from importlib import import_module

        module = sys.modules[package]
        if not places:
            places.update(_places(module))
        if name == "__all__":
            value: object = sorted(places)
        elif name in places:
            found: Any = getattr(import_module(places[name]), name)
            value = found
            if checked and type(found).__name__ == "function":
                from cubicfish.arguments import checked as hold

                value = hold(found, package)
        else:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        setattr(module, name, value)
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *sys.modules[package].__all__})

    return load, names


def _places(module: Any) -> dict[str, str]:
    """Name -> module, for each name that a package's stub imports."""
    data: bytes = module.__loader__.get_data(f"{module.__path__[0]}/__init__.pyi")
    lines = (line.split() for line in data.decode("utf-8").splitlines())
    return {line[-1]: line[1] for line in lines if line[:1] == ["from"]}
