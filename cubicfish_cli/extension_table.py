"""The table of extensions: what stands around the core, and what each of them adds to it.

An extension is a folder below ``extensions/`` and a line of the table here, or another
distribution with an entry point of the group ``cubicfish.extensions``. Nothing of it is loaded
before it is asked; ``extension_guard.py`` does that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

GROUP = "cubicfish.extensions"
"""Entry points of this group name the :class:`Extension` of another distribution."""

TABLE = {
    "films": "cubicfish_cli.extensions.films.extension:EXTENSION",
    "formats": "cubicfish_cli.extensions.formats.extension:EXTENSION",
    "native": "cubicfish_cli.extensions.native.extension:EXTENSION",
    "report": "cubicfish_cli.extensions.report.extension:EXTENSION",
    "advice": "cubicfish_cli.extensions.advice.extension:EXTENSION",
    "printing": "cubicfish_cli.extensions.printing.extension:EXTENSION",
    "simulation": "cubicfish_cli.extensions.simulation.extension:EXTENSION",
    "rigs": "cubicfish_cli.extensions.rigs.extension:EXTENSION",
    "shoot": "cubicfish_cli.extensions.shoot.extension:EXTENSION",
}
"""The extensions that come with the package, and where their records are."""


@dataclass(frozen=True, kw_only=True)
class CameraFormat:
    """A format of other tools' camera files; functions are named by ``module:name``.

    Attributes:
        extension: whose it is; no key of the file.
        name: it is read under this one.
        reads: what is read, for people.
        read: path -> lens, with ``camera`` where it :attr:`holds_several` and ``image_size`` where
            it is :attr:`sizeless`; "" where files are only written.
        written: by the names that it is written under: ``what`` comes of it, for people; the
            ``lens`` that the file holds, which exact ones have not; ``front_lens``, another that it
            may hold of a field that ends before 90°, taken where it loses less; ``front_only``,
            what reads it and divides by z first: it sees nothing behind, whatever the lens; and
            ``distance``, ``boards`` where what reads it looks at things as near as these.
        write: :class:`~cubicfish_cli.foreign.file_contents.PlacedLens` -> text; "" where files
            are only read. Raises :class:`~cubicfish.errors.CameraFileError` for values that the
            format does not take.
        exact: whether its files hold the camera itself, so that no lens is fitted: ``write`` is
            then (calibration, the name it is written under, what the user calls it) -> content.
        write_rig: :class:`~cubicfish_cli.foreign.file_contents.LensRig` -> text, or texts by the
            names of files; "" where it holds no rigs.
        file_name, rig_name: what its file, and that or the folder of a rig, are usually called.
        holds_several: whether a file holds several cameras, of which one is named.
        sizeless: whether a file may not say how large the photos are.
        lensless: whether a file may not say whose its four coefficients are: ``lens``, a fisheye's
            or a pinhole's, is given where the user says so.
        marks: sets of words of which one is in every file; files are recognised by them.
        vague: whether others' files may hold the words too, so that theirs are looked for first.
        looks_like: text -> whether it is a file without such words; asked after all words.
        binary_looks_like: tells files that are no text.

    """

    checked_fields: ClassVar = True

    extension: str
    name: str
    reads: str = ""
    read: str = ""
    written: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    write: str = ""
    exact: bool = False
    write_rig: str = ""
    file_name: str = ""
    rig_name: str = ""
    holds_several: bool = False
    sizeless: bool = False
    lensless: bool = False
    marks: Sequence[Sequence[str]] = ()
    vague: bool = False
    looks_like: str = ""
    binary_looks_like: str = ""


@dataclass(frozen=True, kw_only=True)
class Input:
    """What a camera is calibrated from beside photos, such as films; functions are ``module:name``.

    Attributes:
        among: inputs -> those of them that are of this kind.
        photos: (those, folder, target, best, run) -> photos of them (``cubicfish.photos.Photo``),
            at most ``best``, in files of the folder; and why there are no more, in a sentence.

    """

    checked_fields: ClassVar = True

    among: str
    photos: str


@dataclass(frozen=True, kw_only=True)
class Output:
    """What is made of a calibration while it is at hand, and written beside camera.yaml.

    Attributes:
        file: its name in the calibration's folder.
        content: ``module:name`` of the function (fit, its pairs, the photos' files) -> content.
        needs: libraries without which there is none.

    """

    checked_fields: ClassVar = True

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
        words: ``module:WORDS``, the functions that write its sentences.
        needs: names of other extensions: its modules may import theirs, and it is left out where
            one of them is not there.

    What it adds may not be called as something of the core, or of another extension: commands, the
    kinds and files of outputs, formats. A command of another's group needs that extension.

    """

    checked_fields: ClassVar = True

    commands: Mapping[str, str] = field(default_factory=dict)
    inputs: Sequence[Input] = ()
    formats: Path | None = None
    outputs: Mapping[str, Output] = field(default_factory=dict)
    words: str | None = None
    needs: Sequence[str] = ()
