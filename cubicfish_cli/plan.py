"""What a run reads and what it writes: no output replaces an input, or another output.

Every command has a :class:`Plan`, and asks it before the work. Names that are only known later,
such as those of pictures of chosen frames, are added when they are.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from glob import has_magic
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Self

from cubicfish import OutputError, Run, UsageError
from cubicfish.files import Content, refuse_existing, write_files
from cubicfish_cli.inputs.paths import RECORDING_SUFFIXES, file_and_topic
from cubicfish_cli.inputs.target_source import TargetSource

_Identity = tuple[int, int]


class Plan:
    """The register of a run: what it reads, and what it writes.

    Attributes:
        removed: what an earlier run had left and this one has removed.

    """

    def __init__(self, run: Run, *, skip_existing: bool | None = None) -> None:
        """Begin with nothing.

        Args:
            run: whether files may be replaced.
            skip_existing: whether outputs that exist stay as they are; None where the command
                cannot leave them out.

        Raises:
            UsageError: existing outputs are to be replaced and to be left out.

        """
        if skip_existing and run.overwrite:
            raise UsageError("--skip-existing and --overwrite exclude each other")
        self._overwrite = run.overwrite
        self._skips, self._can_skip = bool(skip_existing), skip_existing is False
        self._named: list[Path] = []  # inputs that nobody has looked for yet
        self._inputs: dict[_Identity, Path] = {}
        self._left: list[Path] = []
        self.removed: list[Path] = []
        self._outputs: dict[tuple[str, str], list[Path]] = {}

    def reads(self, *given: object) -> Self:
        """Add inputs as a caller names them.

        Args:
            given: a name, several of them, or a :class:`TargetSource`; anything else is in memory,
                and no file. A folder stands for the photos and films in it, and a pattern for those
                that it matches.

        Raises:
            OutputError: one is an output.

        """
        self._named += [path for one in given for path in _paths_in(one)]
        for paths in self._outputs.values():
            self._refuse_inputs(paths)
        return self

    def writes(self, *paths: Path, within: Path | None = None) -> list[Path]:
        """Add files to write.

        Args:
            paths: the files.
            within: the folder that must hold all of them, at any depth, where their names come from
                a file.

        Returns:
            Those that are still to be written: all, unless existing ones are left out.

        Raises:
            OutputError: one is an input under this or another name, is named twice, exists and may
                be neither replaced nor left out, is elsewhere, or cannot be written.

        """
        self._refuse_inputs(paths)
        self._refuse_twice(paths)
        wanted = [path for path in paths if not (self._skips and path.is_file())]
        refuse_existing(*wanted, overwrite=self._overwrite, can_skip=self._can_skip, folder=within)
        return wanted

    def leaves(self, *paths: Path) -> None:
        """Add files that an earlier run may have left, and that go where this one has none.

        Those that are inputs stay.
        """
        self._left += [path for path in paths if not self.is_read(path)]

    def write(self, contents: Mapping[Path, Content | None]) -> list[Path]:
        """Write planned files, all together or none.

        Args:
            contents: path -> what it holds; None for a file that is not to be.

        Returns:
            The files that were written.

        Raises:
            OutputError: one exists and may not be replaced, or cannot be written.

        """
        files = {path: content for path, content in contents.items() if content is not None}
        planned = {path for paths in self._outputs.values() for path in paths}
        assert files.keys() <= planned, f"not planned: {files.keys() - planned}"
        left = [path for path in self._left if path not in files and path.is_file()]
        obsolete = left if self._overwrite else ()
        written = write_files(files, overwrite=self._overwrite, obsolete=obsolete)
        self.removed = [path for path in obsolete if not path.exists()]
        return written

    def is_read(self, path: Path) -> bool:
        """Whether a file is an input, whatever it is called there."""
        return self._name_of_input(path) is not None

    def _name_of_input(self, path: Path) -> Path | None:
        own = _identity(path)
        if own is None:  # there is no such file yet
            return None
        while self._named:
            for file in _files_of(self._named.pop(0)):
                found = _identity(file)
                if found is not None:
                    self._inputs.setdefault(found, file)
        return self._inputs.get(own)

    def _refuse_inputs(self, paths: Iterable[Path]) -> None:
        for path in paths:
            name = self._name_of_input(path)
            if name is not None:
                same = "" if name == path else f"the same file as {name}, which is "
                raise OutputError(
                    f"is {same}read here, and would be replaced: choose another name or folder "
                    "for the result",
                    about=str(path),
                )

    def _refuse_twice(self, paths: Iterable[Path]) -> None:
        for path in paths:
            folder = os.path.realpath(path.parent)
            before = self._outputs.setdefault((folder, path.name.casefold()), [])
            if any(one.name == path.name or not _tells_case(Path(folder)) for one in before):
                raise OutputError(
                    "would be written twice: give each result a name of its own", about=str(path)
                )
            before.append(path)


def _paths_in(given: object) -> Iterator[Path]:
    """The names of files in what a caller may name."""
    if isinstance(given, str | os.PathLike):
        yield file_and_topic(Path(given))[0]
    elif isinstance(given, TargetSource):
        yield from _paths_in(given.path)
    elif isinstance(given, Sequence | Mapping):
        for one in given.values() if isinstance(given, Mapping) else given:
            yield from _paths_in(one)


def _files_of(name: Path) -> Iterable[Path]:
    """The files that a name stands for."""
    is_pattern = has_magic(str(name)) and not os.path.lexists(name)
    if not (is_pattern or name.is_dir()):
        return [name]
    from cubicfish.photos import PictureFile, expand_pattern

    read = {*PictureFile.SUFFIXES, *PictureFile.VIDEO_SUFFIXES, *RECORDING_SUFFIXES}
    try:
        inside = expand_pattern(name) if is_pattern else list(name.iterdir())
    except OSError:  # no permission, which is said where it is read
        return []
    return [path for path in inside if path.suffix.lower() in read]


def _identity(path: Path) -> _Identity | None:
    """What all names of a file share: links, and letters that its folder does not tell apart."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return None
    return found.st_dev, found.st_ino


def _tells_case(folder: Path) -> bool:
    """Whether names in a folder that differ in large and small letters only are two files."""
    above = next(one for one in (folder, *folder.parents) if one.is_dir())
    try:
        with NamedTemporaryFile(prefix=".a", suffix=".part", dir=above) as file:
            trial = Path(file.name)
            return not trial.with_name(trial.name.swapcase()).exists()
    except OSError:  # nothing can be written there, which is said elsewhere
        return True
