"""The table of extensions: what stands around the core, and what each of them adds to it.

An extension is a folder below ``extensions/`` and a line of the table here, or another
distribution with an entry point of the group ``cubicfish.extensions``. Nothing of it is loaded
before it is asked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from cubicfish_cli.core.errors import CubicfishError

GROUP = "cubicfish.extensions"
"""Entry points of this group name the :class:`Extension` of another distribution."""

TABLE = {
    "films": "cubicfish_cli.extensions.films.extension:EXTENSION",
    "formats": "cubicfish_cli.extensions.formats.extension:EXTENSION",
    "report": "cubicfish_cli.extensions.report.extension:EXTENSION",
    "advice": "cubicfish_cli.extensions.advice.extension:EXTENSION",
    "printing": "cubicfish_cli.extensions.printing.extension:EXTENSION",
    "simulation": "cubicfish_cli.extensions.simulation.extension:EXTENSION",
    "rigs": "cubicfish_cli.extensions.rigs.extension:EXTENSION",
}
"""The extensions that come with the package, and where their records are."""


@dataclass(frozen=True, kw_only=True)
class CameraFiles:
    """A format of another tool, by its names; known without what reads and writes it.

    Attributes:
        place: ``module:name`` of its :class:`~cubicfish_cli.app.lenses.camera_format.CameraFormat`.
        written: names that it is written under, and what comes of each.
        read: the name that it is read under; None where it is only written.
        reads: what is read.

    """

    place: str
    written: Mapping[str, str]
    read: str | None = None
    reads: str = ""


@dataclass(frozen=True, kw_only=True)
class Output:
    """What is made of a calibration while it is at hand, and written beside camera.yaml.

    Attributes:
        file: its name.
        content: ``module:name`` of the function (fit, its pairs, the photos' files) -> content.
        needs: libraries without which there is none.

    """

    file: str
    content: str
    needs: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Extension:
    """What an extension adds.

    Attributes:
        commands: of ``cubicfish``: name -> ``module:command``, which is imported when it is named;
            ``target print`` is one of the group ``target``.
        inputs: ``module:name`` of functions (inputs, folder, target, best, run) -> (inputs, why)
            that put photos, which go into the folder, in the place of inputs that are theirs, and
            say why no more were chosen; None where none is theirs.
        formats: in which other tools keep cameras.
        outputs: what ``--report`` adds to a calibration: kind -> what it is.
        words: a file of its sentences, as words/catalogue.toml has them.

    """

    commands: Mapping[str, str] = field(default_factory=dict)
    inputs: Sequence[str] = ()
    formats: Sequence[CameraFiles] = ()
    outputs: Mapping[str, Output] = field(default_factory=dict)
    words: Path | None = None


def load_place(place: str) -> Any:
    """What ``module:name`` is."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


@cache
def extensions() -> tuple[Extension, ...]:
    """Those of the table, and those that are installed beside the package.

    Raises:
        CubicfishError: an installed one cannot be loaded.

    """
    own = map(load_place, TABLE.values())
    return (*own, *map(_load_installed, entry_points(group=GROUP)))


def _load_installed(entry: EntryPoint) -> Extension:
    try:
        found = entry.load()
    except Exception as problem:
        raise CubicfishError(
            f"the extension {entry.name} ({entry.value}) cannot be loaded: {problem}: install it "
            "again, or remove it"
        ) from problem
    if not isinstance(found, Extension):
        raise CubicfishError(
            f"the extension {entry.name} ({entry.value}) is no "
            "cubicfish_cli.app.extensions.Extension: update it, or remove it"
        )
    return found


def extension_commands(group: str = "") -> dict[str, str]:
    """The commands of all extensions: name -> ``module:command``; of a group, those within it."""
    named = [
        (name.rpartition(" "), at) for one in extensions() for name, at in one.commands.items()
    ]
    return {name: place for (of, _, name), place in named if of == group}


def camera_formats() -> list[CameraFiles]:
    """The formats of all extensions."""
    return [made for one in extensions() for made in one.formats]


def written_formats() -> dict[str, str]:
    """Format that is written -> what comes of it."""
    return {name: what for one in camera_formats() for name, what in one.written.items()}


def read_formats() -> dict[str, str]:
    """Format that is read -> what is read."""
    return {one.read: one.reads for one in camera_formats() if one.read is not None}
