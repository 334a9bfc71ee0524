"""Library versions that decide results, compared between this machine and the workers."""

from __future__ import annotations

import importlib
import platform
from collections.abc import Callable, Mapping

from cubicfish_cli.errors import ClusterError

DECISIVE = {"cubicfish": "cubicfish_cli", "OpenCV": "cv2", "numpy": "numpy"}
"""Name -> module; results may differ in their last digits from one version to another."""


def versions_here() -> dict[str, str]:
    """The versions that decide what comes out, by name."""
    versions: dict[str, str] = asker()(DECISIVE)[1]
    return versions


def asker() -> Callable[[Mapping[str, str]], tuple[str, dict[str, str]]]:
    """What asks a process for its versions, where this package may be missing.

    A function inside a function travels as code; a module's own travels as a name.
    """

    def ask(modules: Mapping[str, str]) -> tuple[str, dict[str, str]]:
        versions = {}
        for name, module in modules.items():
            try:
                versions[name] = str(importlib.import_module(module).__version__)
            except ImportError:
                versions[name] = ""
        return platform.node(), versions

    return ask


def compare(theirs: Mapping[str, str], mine: Mapping[str, str], who: str) -> None:
    """Raise :class:`ClusterError` when ``who`` lacks one of these, or has another version."""
    for name, version in mine.items():
        has = theirs.get(name, "")
        if not has:
            raise ClusterError(f"{who} has no {name}: install {name} {version} there as it is here")
        if has != version:
            raise ClusterError(
                f"{who} has {name} {has} and this machine has {version}, whose results may "
                "differ: install the same version"
            )
