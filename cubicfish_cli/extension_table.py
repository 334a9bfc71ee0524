"""The table of extensions: what stands around the core, and what each of them adds to it.

An extension is a folder below ``extensions/`` and a line of the table here, or another
distribution with an entry point of the group ``cubicfish.extensions``. Nothing of it is loaded
before it is asked.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from pkgutil import resolve_name

from cubicfish import CubicfishError

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
class CameraFormat:
    """A format of other tools' camera files; functions are named by ``module:name``.

    Attributes:
        name: it is read under this one.
        reads: what is read, for people.
        read: path -> lens, with ``camera`` where it :attr:`holds_several` and ``image_size`` where
            it is :attr:`sizeless`; "" where files are only written.
        written: by the names that it is written under: ``what`` comes of it, for people; the
            ``lens`` that the file holds; and ``front_only``, what reads it and divides by z first:
            it sees nothing behind, whatever the lens.
        write: :class:`~cubicfish_cli.foreign.file_contents.PlacedLens` -> text. Raises
            :class:`~cubicfish.errors.CameraFileError` for values that the format does not
            take.
        write_rig: :class:`~cubicfish_cli.foreign.file_contents.LensRig` -> text, or texts by the
            names of files; "" where it holds no rigs.
        file_name, rig_name: what its file, and that or the folder of a rig, are usually called.
        holds_several: whether a file holds several cameras, of which one is named.
        sizeless: whether a file may not say how large the photos are.
        marks: sets of words of which one is in every file; files are recognised by them.
        vague: whether others' files may hold the words too, so that theirs are looked for first.
        looks_like: text -> whether it is a file without such words; asked after all words.
        binary_looks_like: tells files that are no text.

    """

    name: str
    reads: str = ""
    read: str = ""
    written: Mapping[str, Mapping[str, str]]
    write: str
    write_rig: str = ""
    file_name: str
    rig_name: str = ""
    holds_several: bool = False
    sizeless: bool = False
    marks: Sequence[Sequence[str]] = ()
    vague: bool = False
    looks_like: str = ""
    binary_looks_like: str = ""


@dataclass(frozen=True, kw_only=True)
class Input:
    """What a camera is calibrated from beside photos, such as films; functions are ``module:name``.

    Attributes:
        among: inputs -> those of them that are of this kind.
        photos: (those, folder, target, best, run) -> photos of them, at most ``best``, which go
            into the folder; and why there are no more, in a sentence.

    """

    among: str
    photos: str


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
        inputs: what a camera may be calibrated from beside photos.
        formats: a file of :class:`CameraFormat` by their names, in which other tools keep cameras.
        outputs: what ``--report`` adds to a calibration: kind -> what it is.
        words: a file of its sentences, as words/catalogue.toml has them.

    """

    commands: Mapping[str, str] = field(default_factory=dict)
    inputs: Sequence[Input] = ()
    formats: Path | None = None
    outputs: Mapping[str, Output] = field(default_factory=dict)
    words: Path | None = None


@cache
def extensions() -> tuple[Extension, ...]:
    """Those of the table, and those that are installed beside the package.

    Raises:
        CubicfishError: an installed one cannot be loaded.

    """
    own = map(resolve_name, TABLE.values())
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
            "cubicfish_cli.extension_table.Extension: update it, or remove it"
        )
    return found


def extension_commands(group: str = "") -> dict[str, str]:
    """The commands of all extensions: name -> ``module:command``; of a group, those within it."""
    named = [
        (name.rpartition(" "), at) for one in extensions() for name, at in one.commands.items()
    ]
    return {name: place for (of, _, name), place in named if of == group}


@cache
def camera_formats() -> tuple[CameraFormat, ...]:
    """The formats of all extensions."""
    files = [one.formats for one in extensions() if one.formats is not None]
    tables = [tomllib.loads(file.read_text(encoding="utf-8")) for file in files]
    return tuple(CameraFormat(name=name, **own) for table in tables for name, own in table.items())


def written_formats() -> dict[str, CameraFormat]:
    """The format of each name that one is written under."""
    return {name: one for one in camera_formats() for name in one.written}


def read_formats() -> dict[str, CameraFormat]:
    """The format of each name that one is read under."""
    return {one.name: one for one in camera_formats() if one.read}
