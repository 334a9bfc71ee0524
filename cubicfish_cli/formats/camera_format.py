"""What a camera format of another tool offers: the ``FORMAT`` of its module."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cubicfish_cli.formats.lens_rig import LensRig
from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.types import FloatArray

Poses = Mapping[str, tuple[FloatArray, FloatArray]]
"""camera_from_world, rotation (3, 3) and translation (3,), by the photo's name."""


@dataclass(frozen=True, kw_only=True)
class CameraFormat:
    """A format.

    Attributes:
        lenses: by the names that it is written under, the lens that the file holds.
        file_name: what its file is usually called.
        write: lens, notes of how it was made and photos' poses -> text. Raises
            :class:`~cubicfish_cli.errors.CameraFileError` for values that the format does not take.
        comments: whether the notes get into the file.
        read: path -> lens, with ``camera`` where it :attr:`holds_several` and ``image_size`` where
            it is :attr:`sizeless`. None where files are only written.
        holds_several: whether a file holds several cameras, of which one is named.
        sizeless: whether a file may not say how large the photos are.
        marks: sets of words of which one is in every file; files are told by them.
        vague: whether others' files may hold the words too, so that theirs are looked for first.
        looks_like: tells files that have no such words; asked after all words.
        binary_looks_like: tells files that are no text.
        rig: what the file, or the folder of files, of a rig is usually called, and what it holds.
        front_only: by the name it is written under, what reads it and divides by z first: it sees
            nothing behind, whatever the lens.

    """

    lenses: Mapping[str, type[Lens]]
    file_name: str
    write: Callable[[Any, Sequence[str], Poses], str]
    comments: bool = True
    read: Callable[..., Lens] | None = None
    holds_several: bool = False
    sizeless: bool = False
    marks: Sequence[Sequence[str]] = ()
    vague: bool = False
    looks_like: Callable[[str], bool] | None = None
    binary_looks_like: Callable[[bytes], bool] | None = None
    rig: tuple[str, Callable[[LensRig], str | dict[str, str]]] | None = None
    front_only: Mapping[str, str] = field(default_factory=dict)
