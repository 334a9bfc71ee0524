"""cubicfish, as a program names it: every public name of :mod:`cubicfish_cli`, and nothing else."""

import cubicfish_cli as _package

__version__ = _package.__version__
__all__ = _package.__all__


def __getattr__(name: str) -> object:
    """Load a public name when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(_package, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
