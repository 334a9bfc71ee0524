"""Extensions that work: each is loaded and checked by itself, and one that fails is left out.

What is left out is named once, by an :class:`ExtensionWarning`, with all that needs it; everything
else goes on as if it had never been installed. The program shows the warning as a line on stderr.
"""

import re
import signal
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path, PurePosixPath, PureWindowsPath
from pkgutil import resolve_name
from typing import Any, NamedTuple

from cubicfish import CubicfishError, quoted
from cubicfish.arguments import refuse_misfit
from cubicfish_cli.core_table import CALIBRATION_FILES, COMMANDS, FRAMES, MAPS, commands_of
from cubicfish_cli.extension_table import GROUP, TABLE, CameraFormat, Extension, Output

_COMMAND = re.compile(r"(?:[a-z][a-z0-9-]* )?[a-z][a-z0-9-]*")
_PLACE = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")
# Such as no path has, and no message breaks at.
_NAME = re.compile(r"[\w+-][\w+. -]{0,60}[\w+-]|[\w+-]")
_MOST_BYTES = 1_000_000


class ExtensionWarning(UserWarning):
    """An extension is left out: which one, why, and what to do, in one line."""


class _BadExtension(Exception):
    """Why an extension cannot be used."""


class Place(NamedTuple):
    """What an extension names by ``module:name``.

    Attributes:
        extension: whose it is.
        at: its module and its name.

    """

    extension: str
    at: str

    def load(self) -> Any:
        """What stands there.

        Raises:
            CubicfishError: it cannot be loaded; the extension is left out then.

        """
        try:
            with _guarded():
                return resolve_name(self.at)
        except _BadExtension as problem:
            why = f"{self.at} cannot be loaded ({problem})"
            raise CubicfishError(_loaded().leave_out(self.extension, why)) from problem.__cause__

    def load_or_leave_out(self, kind: type) -> Any:
        """What stands there, of a kind; None where there is no such thing."""
        try:
            found = self.load()
        except CubicfishError as problem:
            _warn(str(problem), problem.__cause__)
            return None
        if isinstance(found, kind):
            return found
        _warn(_loaded().leave_out(self.extension, f"{self.at} is no {kind.__name__}"))
        return None

    def attempt(self, *given: Any) -> Any:
        """What the function there makes of something that nobody has asked it for by name.

        Returns:
            None where it fails, of which the user is warned.

        Raises:
            CubicfishError: it says that a user's input cannot be used.

        """
        function = self.load_or_leave_out(Callable)  # type: ignore[arg-type]
        try:
            return None if function is None else function(*given)
        except CubicfishError:
            raise
        except Exception as problem:
            self.warn_of(problem)
        return None

    def warn_of(self, problem: Exception) -> None:
        """Say that the function there failed, and that there is nothing of it this time."""
        _warn(
            _loaded().explain(self.extension, f"{self.at} fails ({_in_a_line(problem)})"), problem
        )


class _Loaded:
    """The extensions, and what is known of their formats.

    Attributes:
        sound: those that are used, by name.
        formats: of each, its formats.

    """

    def __init__(self) -> None:
        self.sound: dict[str, Extension] = {}
        self.formats: dict[str, tuple[CameraFormat, ...]] = {}
        self._places = dict(TABLE)

    def load(self) -> None:
        """Load all of them, and leave out what fails."""
        from importlib.metadata import entry_points  # most commands do without

        installed = [(one.name, one.value) for one in entry_points(group=GROUP)]
        for name, place in (*TABLE.items(), *installed):
            taken = name in self.sound
            self._places[name] = place
            try:
                if taken or not _NAME.fullmatch(name):
                    raise _BadExtension("another one is called so" if taken else "it has no name")
                record = _load_record(place)
                self.formats[name] = _read_formats(name, record)
                self.sound[name] = record
            except _BadExtension as problem:
                _warn(self.explain(name, str(problem)), problem.__cause__)
        self._leave_out_what_clashes()

    def leave_out(self, name: str, why: str) -> str:
        """Go on without one, and without what needs it; return what there is to say of it."""
        self.sound.pop(name, None)
        self._leave_out_what_clashes()
        return self.explain(name, why)

    def explain(self, name: str, why: str) -> str:
        """Say that one is left out."""
        do = "install cubicfish again" if name in TABLE else "update it, or remove it"
        named = f"{quoted(name)[1:-1]} ({self._places[name]})"
        return f"the extension {named} is left out: {why}: {do}"

    def _leave_out_what_clashes(self) -> None:
        """Leave out what needs others that are not there, or takes their names or the core's."""
        taken = dict.fromkeys(_core_names(), "cubicfish itself")
        for name, record in [*self.sound.items()]:
            lacking = [one for one in record.needs if one not in self.sound]
            if lacking:
                why = f"it needs the extension {quoted(lacking[0])}, which is not there"
            else:
                why = self._find_clash(name, record, taken)
            if why:
                _warn(self.leave_out(name, why))
                return

    def _find_clash(self, name: str, record: Extension, taken: dict[str, str]) -> str:
        """Say which name is another's; its own are taken from now on."""
        for group in (one.partition(" ")[0] for one in record.commands if " " in one):
            needed = [record, *(self.sound[one] for one in record.needs)]
            if group not in COMMANDS and not any(group in one.commands for one in needed):
                return f"there is no group of commands {quoted(group)} that it adds to or needs"
        for what in _names_of(record, self.formats[name]):
            if what in taken:
                return f"the {what} is of {taken[what]}"
            taken[what] = f"the extension {quoted(name)}"
        return ""


@cache
def _loaded() -> _Loaded:
    made = _Loaded()
    made.load()
    return made


def _load_record(place: str) -> Extension:
    try:
        with _guarded():
            record = resolve_name(place)
    except _BadExtension as problem:
        raise _BadExtension(f"it cannot be loaded ({problem})") from problem.__cause__
    if not isinstance(record, Extension):
        raise _BadExtension("it is no cubicfish_cli.extension_table.Extension")
    try:
        refuse_misfit("Extension", record, Extension)
    except CubicfishError as problem:
        raise _BadExtension(str(problem)) from problem
    for name in record.commands:
        if not _COMMAND.fullmatch(name):
            raise _BadExtension(f"{quoted(name)} is no name of a command")
    for one in record.outputs.values():
        _check_file_name(one)
    for at in _places_in(record):
        _check_place(at)
    return record


def _places_in(record: Extension) -> Iterator[str]:
    yield from record.commands.values()
    for made in record.inputs:
        yield from (made.among, made.photos)
    for output in record.outputs.values():
        yield output.content
    if record.words is not None:
        yield record.words


def _check_place(at: str) -> None:
    if not _PLACE.fullmatch(at):
        raise _BadExtension(f"{quoted(at)} is no 'module:name'")


def _check_file_name(output: Output) -> None:
    name = output.file
    parts = {PurePosixPath(name).name, PureWindowsPath(name).name}
    if not _NAME.fullmatch(name) or parts != {name}:
        raise _BadExtension(f"{quoted(name)} is no name of a file in the calibration's folder")


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise _BadExtension(f"{path} is larger than {_MOST_BYTES:,} bytes")
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as problem:
        what = problem.strerror if isinstance(problem, OSError) else problem
        raise _BadExtension(f"{path} cannot be read ({what})") from problem


def _read_formats(extension: str, record: Extension) -> tuple[CameraFormat, ...]:
    if record.formats is None:
        return ()
    made = []
    for name, own in _read_toml(record.formats).items():
        try:
            one = CameraFormat(extension=extension, name=name, **own)
            refuse_misfit(name, one, CameraFormat)
        except (TypeError, CubicfishError) as problem:
            what = str(problem).replace("CameraFormat.__init__() ", "")
            raise _BadExtension(
                f"{record.formats}: {quoted(name)} is no format: {what}"
            ) from problem
        is_written = one.written and one.write and one.file_name
        if not is_written and (one.written or not one.read):
            raise _BadExtension(
                f"{record.formats}: {quoted(name)} needs 'read', or 'write', 'written' and "
                "'file_name'"
            )
        for written, keys in one.written.items():
            if not one.exact and not {"what", "lens"} <= keys.keys():
                raise _BadExtension(f"{record.formats}: {quoted(written)} needs 'what' and 'lens'")
        functions = (one.read, one.write, one.write_rig, one.looks_like, one.binary_looks_like)
        lenses = (
            keys.get(key, "") for keys in one.written.values() for key in ("lens", "front_lens")
        )
        for at in filter(None, (*lenses, *functions)):
            _check_place(at)
        made.append(one)
    return tuple(made)


def _core_names() -> Iterator[str]:
    yield from (f"command {quoted(name)}" for name in COMMANDS)
    yield from (f"output {quoted(kind)}" for kind in CALIBRATION_FILES)
    yield from (f"file {quoted(name)}" for name in (*CALIBRATION_FILES.values(), FRAMES))
    yield f"format {quoted(MAPS)}"


def _names_of(record: Extension, formats: tuple[CameraFormat, ...]) -> Iterator[str]:
    yield from (f"command {quoted(name)}" for name in record.commands)
    yield from (f"output {quoted(kind)}" for kind in record.outputs)
    # Some folders do not tell A from a.
    yield from (f"file {quoted(one.file.casefold())}" for one in record.outputs.values())
    named = {name for one in formats for name in (one.name, *one.written)}
    yield from (f"format {quoted(name)}" for name in sorted(named))


@contextmanager
def _guarded() -> Iterator[None]:
    """Run others' modules, whatever they do: nothing of it reaches the program.

    Raises:
        _BadExtension: they fail, end the program, or print on standard output.

    """
    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(StringIO()):
            yield
    except KeyboardInterrupt as problem:
        # The program's own signals are of another class; where Python's handler is at work it may
        # be the user who has pressed Ctrl-C.
        is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if is_default or type(problem) is not KeyboardInterrupt:
            raise
        raise _BadExtension(_in_a_line(problem)) from problem
    except (Exception, SystemExit) as problem:
        raise _BadExtension(_in_a_line(problem)) from problem
    if said.getvalue():
        raise _BadExtension("it prints on standard output while it is imported")


def _in_a_line(problem: BaseException) -> str:
    lines = f"{type(problem).__name__}: {problem}".splitlines()
    return lines[0].rstrip(": ")


def _warn(text: str, problem: BaseException | None = None) -> None:
    warning = ExtensionWarning(text)
    warning.__cause__ = problem
    warnings.warn(warning, stacklevel=3)


def extensions() -> Mapping[str, Extension]:
    """Those of the table, and those that are installed beside the package, by name."""
    return _loaded().sound


def extension_commands(group: str = "") -> dict[str, Place]:
    """The commands of all extensions by name, and where each is; of a group, those within it."""
    return {
        name: Place(own, at)
        for own, one in extensions().items()
        for name, at in commands_of(one.commands, group).items()
    }


def camera_formats() -> tuple[CameraFormat, ...]:
    """The formats of all extensions."""
    return tuple(one for name in extensions() for one in _loaded().formats[name])


def written_formats() -> dict[str, CameraFormat]:
    """The format of each name that one is written under."""
    return {name: one for one in camera_formats() for name in one.written}


def read_formats() -> dict[str, CameraFormat]:
    """The format of each name that one is read under."""
    return {one.name: one for one in camera_formats() if one.read}
