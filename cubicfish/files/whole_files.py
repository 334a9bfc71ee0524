"""Writing files so that they appear whole or not at all, and never replace others unasked."""

import hashlib
import os
import platform
import re
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from itertools import islice
from pathlib import Path

from cubicfish.errors import CubicfishError, OutputError

StrPath = str | os.PathLike[str]

_host: ContextVar[str] = ContextVar("host", default="")


def on_host() -> str:
    """The text `` on node7`` while node7 works for another machine, else an empty one."""
    name = _host.get()
    return f" on {name}" if name else ""


@contextmanager
def working_on(name: str) -> Iterator[None]:
    """Mark the work inside as done for another machine on the host ``name``: messages say so."""
    token = _host.set(name)
    try:
        yield
    finally:
        _host.reset(token)


Content = str | bytes | Callable[[Path], object]
"""What a file shall hold: text, bytes, or a function that writes it to the name that it is
given."""


def refuse_existing(
    *paths: Path, overwrite: bool, can_skip: bool = False, folder: Path | None = None
) -> None:
    """Raise :class:`OutputError` when one of ``paths`` may not be replaced, or cannot be written.

    Args:
        paths: the files that are to be written.
        overwrite: whether they may be replaced.
        can_skip: whether the calling command can leave out existing files.
        folder: the folder that must hold all of them, at any depth, where their names were read
            from a file.

    """
    if folder is not None:
        _refuse_outside(folder, paths)
    for path in paths:
        if os.path.isdir(path):
            raise OutputError("is a folder: give the name of a file", about=str(path))
        if not overwrite and os.path.lexists(path):
            raise OutputError(
                "exists already",
                do="choose another name or add {overwrite}" + " or {skip_existing}" * can_skip,
                about=str(path),
                arguments={"overwrite": "overwrite=True", "skip_existing": "skip_existing=True"},
            )
        if os.path.exists(path) and not os.path.isfile(path):
            raise OutputError(
                "is no plain file, and is not replaced: choose another name", about=str(path)
            )
        _refuse_unwritable(path)


def _refuse_outside(folder: Path, paths: Iterable[Path]) -> None:
    """Raise :class:`OutputError` when one of ``paths`` leads out of the folder that was named.

    The user names the folder, but names of files in it may come from somebody else's file.
    """
    for path in paths:
        if not path.is_relative_to(folder) or ".." in path.relative_to(folder).parts:
            raise OutputError(
                f"is outside of {folder}, where results go, and is not written: check the names "
                "in the files that are read",
                about=str(path),
            )


_writable: set[Path] = set()


def _refuse_unwritable(path: Path) -> None:
    """Raise :class:`OutputError` when no file can be made at ``path``.

    Where its folder does not exist yet, the nearest existing one above it is tried, once per
    process.
    """
    folder = next(above for above in path.absolute().parents if os.path.lexists(above))
    if folder in _writable:
        return
    if not folder.is_dir():
        raise OutputError(f"cannot be written: {folder} is a file, not a folder", about=str(path))
    trial = _temporary_name(folder / path.name)
    try:
        os.close(os.open(trial, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        os.unlink(trial)
    except OSError as error:
        raise _explain_unwritable(path, error) from error
    _writable.add(folder)


def _explain_unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(
        f"cannot be written{on_host()} ({error.strerror or error}): check the folder, its "
        "permissions and the free space",
        about=str(path),
    )


@contextmanager
def whole_file(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary name beside ``path`` that becomes ``path`` when the block succeeds.

    The temporary file keeps the suffix of ``path``, since writers choose the format by it.
    Without ``overwrite`` the final step is a hard link, which fails if the name was taken
    in the meantime; with it, an atomic rename.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    with whole_files([path], overwrite=overwrite) as (temporary,):
        yield temporary


@contextmanager
def whole_files(
    paths: Sequence[Path],
    *,
    overwrite: bool,
    obsolete: Sequence[Path] = (),
    folder: Path | None = None,
) -> Iterator[tuple[Path, ...]]:
    """Yield one temporary name for each path; all become final when the block succeeds.

    Names that are taken are refused before the block starts. When the block fails, no new file is
    left, and the files that were to be replaced are as before.

    The first path becomes final last, and is removed first where it is replaced: even if the
    process is killed in between, the other files stand beside it wherever it exists, and are its
    own.

    Args:
        paths: the files.
        overwrite: whether they may be replaced.
        obsolete: files of earlier results that are removed when the new ones are there.
        folder: the folder that must hold all of them, at any depth, where their names were read
            from a file.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, cannot be written, or is elsewhere.

    """
    paths = [Path(path) for path in paths]
    if folder is not None:
        _refuse_outside(folder, obsolete)
    refuse_existing(*paths, overwrite=overwrite, folder=folder)
    for place in {path.parent for path in paths}:
        if not _was_searched(place):
            remove_orphans(place)
    together = {path: _temporary_name(path) for path in paths}
    aside = {path: _temporary_name(path) for path in (*paths, *obsolete)} if overwrite else {}
    try:
        with _naming(*paths, *obsolete):
            for path in paths:
                with _naming(path):
                    path.parent.mkdir(parents=True, exist_ok=True)
            yield tuple(together.values())
            for path, temporary in together.items():
                with _naming(path), temporary.open("rb+") as file:
                    os.fsync(file.fileno())
            if not overwrite:
                _put_at_free_names(together)
            elif len(aside) == 1:
                os.replace(together[paths[0]], paths[0])
            else:
                _replace(together, aside)
    finally:
        _remove((*together.values(), *aside.values()))


@contextmanager
def _naming(*paths: Path) -> Iterator[None]:
    """Name the file in what the system refuses: the one that is at fault, else the first."""
    try:
        yield
    except CubicfishError:  # says what went wrong already, and some are OSErrors too
        raise
    except OSError as error:
        at_fault = {str(name) for name in (error.filename, error.filename2) if name is not None}
        path = next((path for path in paths if str(path) in at_fault), paths[0])
        raise _explain_unwritable(path, error) from error


def _put_at_free_names(together: dict[Path, Path]) -> None:
    """Give temporary files (path -> temporary) their names, all or none."""
    try:
        for path, temporary in reversed(together.items()):
            _move_to_free_name(temporary, path)
    except BaseException:
        for path, temporary in together.items():
            with suppress(OSError):
                if not temporary.exists() or temporary.samefile(path):  # else somebody else's
                    path.unlink(missing_ok=True)
        raise


def _replace(together: dict[Path, Path], aside: dict[Path, Path]) -> None:
    """Replace files, all or none, by temporary ones.

    Args:
        together: path -> its temporary file.
        aside: path -> where its file is kept until all is done; these paths and other ones that are
            removed.

    """
    try:
        for path, old in aside.items():
            with suppress(FileNotFoundError):
                os.replace(path, old)
        for path, temporary in reversed(together.items()):
            os.replace(temporary, path)
    except BaseException:
        for path, old in reversed(aside.items()):
            with suppress(OSError):
                if os.path.lexists(old):
                    os.replace(old, path)
                elif path in together and not together[path].exists():  # there was none before
                    path.unlink(missing_ok=True)
        raise


def _remove(paths: Iterable[Path]) -> None:
    """Remove files that may not be there, also when a signal comes meanwhile."""
    try:
        for path in paths:
            with suppress(OSError):  # nothing was made where the folder itself is unusable
                path.unlink(missing_ok=True)
    except KeyboardInterrupt:
        _remove(paths)
        raise


_TEMPORARY = re.compile(
    r"\..*\.(?P<family>[0-9a-f]{12})-(?P<process>[0-9]{1,10})-[0-9a-f]{8}\.part(\.[^.]*)?"
)
# A folder with more files than these is not searched to its end for orphans.
_MOST_ENTRIES = 20_000
_STEM_BYTES = 100


def _temporary_name(path: Path) -> Path:
    """A new name beside ``path`` with its suffix, which says that the file is not finished.

    It is hidden, ``.camera.<family>-<process>-<random>.part.yaml`` for ``camera.yaml``, and names
    the calling process, so that files of a killed process can be recognised.
    """
    stem = os.fsencode(path.stem)[:_STEM_BYTES].decode(errors="ignore")
    token = f"{_family()}-{os.getpid()}-{secrets.token_hex(4)}"
    return path.with_name(f".{stem}.{token}.part{path.suffix}")


@cache
def _family() -> str:
    """12 digits that processes share if each can find out whether the other is alive."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text()
        space = os.readlink("/proc/self/ns/pid")
    except OSError:  # not Linux: a family of one
        return secrets.token_hex(6)
    return hashlib.sha256(f"{platform.node()} {boot} {space}".encode()).hexdigest()[:12]


def remove_orphans(folder: Path) -> None:
    """Remove the temporary files in a folder that processes of this machine left when killed."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in islice(entries, _MOST_ENTRIES):
            found = _TEMPORARY.fullmatch(entry.name)
            if found and found["family"] == _family() and not _is_alive(int(found["process"])):
                with suppress(OSError):
                    os.unlink(entry.path)


def _is_alive(process: int) -> bool:
    if process == os.getpid():
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's
        return True
    return True


_searched_folders: set[str] = set()


def _was_searched(folder: Path) -> bool:
    """Whether this was called for the folder before: once per process is enough."""
    name = os.path.abspath(folder)
    before = name in _searched_folders
    _searched_folders.add(name)
    return before


def _move_to_free_name(source: Path, path: Path) -> None:
    try:
        os.link(source, path)
    except FileExistsError:
        refuse_existing(path, overwrite=False)
        raise
    except OSError:  # a file system without hard links: check once more, then rename
        refuse_existing(path, overwrite=False)
        os.replace(source, path)


def write_files(
    files: Mapping[Path, Content],
    *,
    overwrite: bool,
    obsolete: Sequence[Path] = (),
    folder: Path | None = None,
) -> list[Path]:
    """Write files, all or none, as :func:`whole_files` does.

    Args:
        files: path -> its text, its bytes, or a function that writes it to the name that it is
            given.
        overwrite: whether they may be replaced.
        obsolete: files of earlier results that are removed when the new ones are there.
        folder: the folder that must hold all of them, at any depth, where their names were read
            from a file.

    Returns:
        The paths.

    Raises:
        OutputError: a file exists and ``overwrite`` is false, cannot be written, or is elsewhere.

    """
    if files:
        with whole_files(
            list(files), overwrite=overwrite, obsolete=obsolete, folder=folder
        ) as temporaries:
            for temporary, (path, content) in zip(temporaries, files.items(), strict=True):
                with _naming(path):
                    if isinstance(content, str):
                        temporary.write_text(content, encoding="utf-8", newline="\n")
                    elif isinstance(content, bytes):
                        temporary.write_bytes(content)
                    else:
                        content(temporary)
    return list(files)
