"""Options that several commands share, each defined once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from cubicfish_cli.cli.json_keys import keys_of
from cubicfish_cli.cli.numbers import FloatRange, IntRange
from cubicfish_cli.errors import CameraFileError

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

DEBUG_KEY = "cubicfish.debug"
VERBOSITY_KEY = "cubicfish.verbosity"
DEFAULT_MODEL = Path("calibration") / "camera.yaml"
DEFAULT_RIG = Path("rig") / "rig.yaml"

FILE = click.Path(path_type=Path)


class FolderType(click.Path):
    """A path that shells complete with folders only; what it names is checked where it is used."""

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Leave it to the shell."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="dir")]


FOLDER = FolderType(path_type=Path)

NAME = click.Path(readable=False)
"""The name of a file or several, as text: what it means is found out where it is used."""


class Argument(click.Argument):
    """An argument with a meaning, in a few words, for the reference page docs/cli.md.

    ``--help`` says it in the command's description. What is said when it is missing may be given,
    where more than its name is needed to understand it.
    """

    def __init__(self, *args: Any, meaning: str, missing: str | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.meaning = meaning
        self.missing = missing

    def process_value(self, ctx: click.Context, value: Any) -> Any:
        """As click does, but for what is said of a missing value."""
        try:
            return super().process_value(ctx, value)
        except click.MissingParameter:
            if self.missing is None:
                raise
            raise click.UsageError(self.missing, ctx) from None


def argument(
    name: str, meaning: str, *, type: click.ParamType = FILE, **more: Any
) -> Callable[[Decorated], Decorated]:
    """An argument, by default the name of a file; ``more`` as click has it."""
    return click.argument(name, type=type, cls=Argument, meaning=meaning, **more)


class Parsed(click.ParamType):
    """What a function makes of a word of the command line.

    Args:
        name: what help calls it.
        parse: raises a ValueError that says what is wrong, such as a :class:`ViewError`.

    """

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name = name
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse, or fail as a usage error."""
        # A shell completes the line: nothing uses the value, and numpy takes time.
        if not isinstance(value, str) or (ctx is not None and ctx.resilient_parsing):
            return value
        try:
            return self._parse(value)
        except ValueError as problem:
            self.fail(str(problem), param, ctx)


def examples(*lines: str) -> str:
    """An epilog that shows command lines as they are."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def as_command(
    name: str, short_help: str, *lines: str, **more: Any
) -> Callable[[Callable[..., None]], click.Command]:
    """A command, with what all have in common.

    Args:
        name: of the command.
        short_help: what it is for, in the list of commands.
        lines: command lines that show it at work.
        more: as click has it.

    """

    def decorate(function: Callable[..., None]) -> click.Command:
        made = click.command(name, short_help=short_help, epilog=examples(*lines), **more)
        return made(common_options(function))

    return decorate


def option(
    words: str, help: str, type: Any = None, default: Any = None, *, to: str = "", **more: Any
) -> Callable[[Decorated], Decorated]:
    """An option, whose default its help shows.

    Args:
        words: its names, and what its value is called: ``-n --number N``; a flag has no value.
        help: what it is for.
        type: of its value; without one, and without a name of the value, it is a flag.
        default: where it is not given.
        to: the argument that gets its value, where that is not called as it is.
        more: as click has it.

    """
    names = words.split()
    if not names[-1].startswith("-"):
        more["metavar"] = names.pop()
    elif type is None:
        more["is_flag"] = True
    if default is not None:
        more = {"default": default, "show_default": True, **more}
    return click.option(*names, *([to] if to else []), type=type, help=help, **more)


def _remember(
    key: str, value: int | bool
) -> Callable[[click.Context, click.Parameter, bool], None]:
    def callback(ctx: click.Context, _: click.Parameter, given: bool) -> None:
        if given:
            ctx.meta[key] = value

    return callback


def common_options(function: Decorated) -> Decorated:
    """``-v``, ``-q`` and ``--debug``; they may stand before or after the command's name."""
    for decorator in (
        click.option(
            "--debug",
            is_flag=True,
            expose_value=False,
            callback=_remember(DEBUG_KEY, True),
            help="Show the traceback of an error.",
        ),
        click.option(
            "-q",
            "--quiet",
            is_flag=True,
            expose_value=False,
            callback=_remember(VERBOSITY_KEY, -1),
            help="Say nothing but results and errors.",
        ),
        click.option(
            "-v",
            "--verbose",
            is_flag=True,
            expose_value=False,
            callback=_remember(VERBOSITY_KEY, 1),
            help="Say more.",
        ),
    ):
        function = decorator(function)
    return function


def refuse_given(why: str, given: Mapping[str, object]) -> None:
    """Refuse options that say nothing here: name -> value, nothing where it was not given.

    Raises:
        click.UsageError: one was given; the text is its name, and why.

    """
    for name, value in given.items():
        if value:
            raise click.UsageError(f"{name} {why}")


def is_given(parameter: str) -> bool:
    """Whether the command line gives this parameter of the command, and not a default."""
    from click.core import ParameterSource

    source = click.get_current_context().get_parameter_source(parameter)
    return source is ParameterSource.COMMANDLINE


def verbosity() -> int:
    """-1 after ``--quiet``, 1 after ``--verbose``, else 0."""
    value: int = click.get_current_context().meta.get(VERBOSITY_KEY, 0)
    return value


target_option = click.option(
    "-t",
    "--target",
    type=FILE,
    metavar="FILE",
    help="The calibration target: a target.yaml, or one of Kalibr's target files. Where one is "
    "needed, ./target.yaml stands for it.",
)

model_option = click.option(
    "-m",
    "--model",
    type=FILE,
    envvar="CUBICFISH_MODEL",
    metavar="FILE",
    help="The camera: its file, or the folder that calibrate wrote. [default: "
    "$CUBICFISH_MODEL, else calibration/camera.yaml]",
)

calibration_argument = argument(
    "calibration",
    "The folder that calibrate wrote, or the camera's file in it. [default: --model]",
    required=False,
    metavar="[FOLDER|CAMERA_YAML]",
)


def output_option(
    help: str, *, default: str | None = None, folder: bool = False, metavar: str = "", **more: Any
) -> Callable[[Decorated], Decorated]:
    """``-o``, which says where the result goes."""
    if default is not None:
        more |= {"default": default, "show_default": True}
    return click.option(
        "-o",
        "--output",
        type=FOLDER if folder else FILE,
        metavar=metavar or ("FOLDER" if folder else "FILE"),
        help=help,
        **more,
    )


def bundle(
    name: str, kind: Callable[..., Any], *options: Callable[[Any], Any]
) -> Callable[[Decorated], Decorated]:
    """Options that a command gets together as one argument.

    Args:
        name: of the argument.
        kind: makes it of the options' values, by their names: a dataclass with a field for each.
        options: in the order of ``--help``.

    """
    names = list(signature(kind).parameters)

    def decorate(function: Any) -> Any:
        @functools.wraps(function)
        def command(**values: Any) -> Any:
            together = kind(**{one: values.pop(one) for one in names})
            return function(**{name: together}, **values)

        for option in reversed(options):
            command = option(command)
        return command

    return decorate


class JsonOption(click.Option):
    """``--json``, and what the object holds: key -> meaning."""

    def __init__(self, *args: Any, keys: Mapping[str, str], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.keys = dict(keys)


def json_option(command: str) -> Callable[[Decorated], Decorated]:
    """``--json``, which tells the keys of the object that a command prints."""
    keys = keys_of(command)
    return click.option(
        "--json",
        "as_json",
        cls=JsonOption,
        keys=keys,
        is_flag=True,
        help=f"Print one JSON object to stdout, and nothing else. Its keys: {', '.join(keys)}.",
    )


overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that exist.")

jobs_option = click.option(
    "-j",
    "--jobs",
    type=IntRange(min=1),
    metavar="N",
    help="Photos to work on at a time. [default: the number of processors]",
)

no_cache_option = click.option(
    "--no-cache",
    is_flag=True,
    help="Search every photo anew. Otherwise what was found in a photo is kept in "
    "~/.cache/cubicfish (or where CUBICFISH_CACHE says) until the photo changes.",
)

max_rms_option = click.option(
    "--max-rms",
    type=FloatRange(min=0, min_open=True),
    metavar="PX",
    help="Exit with 3 when the RMS is above this; outputs are written all the same.",
)


def refine_target_option(help: str) -> Callable[[Decorated], Decorated]:
    """``--refine-target``: how far the target is fitted too."""
    levels = click.Choice(["off", "shape", "points", "auto"])
    return option("--refine-target", help, levels, "auto")


def _size(text: str) -> tuple[int, int]:
    from cubicfish_cli.corner_files.observations_csv import parse_size

    return parse_size(text)


SIZE = Parsed("WIDTHxHEIGHT", _size)

size_option = click.option(
    "--size", type=SIZE, help="Size of the photos, for CSV files that do not state it."
)


def _pair(text: str) -> tuple[str, str]:
    names = [name.strip() for name in text.split(",")]
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise ValueError(f"{text!r} does not name two cameras, such as left,right")
    return names[0], names[1]


pair_option = click.option(
    "--pair",
    type=Parsed("NAME,NAME", _pair),
    metavar="NAME,NAME",
    help="Two cameras of the rig, such as left,right. [default: those that it has]",
)

rig_option = click.option(
    "--rig",
    "rig",
    type=FILE,
    metavar="FILE",
    help="Several cameras on one body: the rig.yaml, or the folder that rig wrote. "
    "[default, where a rig is needed: rig/rig.yaml]",
)


def rig_file(given: Path | None) -> Path:
    """The rig's file: the one that was given, or in that folder, else the default one.

    Raises:
        CameraFileError: it is not there.

    """
    path = given or DEFAULT_RIG
    path = path / DEFAULT_RIG.name if path.is_dir() else path
    if not path.is_file():
        raise CameraFileError(
            f"there is no {path}: name the rig.yaml that 'cubicfish rig' wrote with --rig"
        )
    return path


def model_path(given: Path | None) -> Path:
    """The camera file to read: the one that was given, else the default one if it is there.

    A folder stands for the camera.yaml in it. A camera that was not named on the command line is
    named on stderr.

    Raises:
        CameraFileError: nothing was given and the default is not there.

    """
    path = given or DEFAULT_MODEL
    if given is None and not path.exists():
        raise CameraFileError(
            f"there is no {DEFAULT_MODEL} here: run 'cubicfish calibrate' first, "
            "or name a camera with --model or $CUBICFISH_MODEL"
        )
    path = in_folder(path)
    if not _is_named():
        from cubicfish_cli.cli.terminal import say

        say(f"Camera: {path}.")
    return path


def in_folder(path: Path) -> Path:
    """The camera file that is meant: a folder stands for the camera.yaml in it.

    Raises:
        CameraFileError: the folder has none.

    """
    if not path.is_dir():
        return path
    inside = path / DEFAULT_MODEL.name
    if not inside.exists():
        raise CameraFileError(
            f"{path} is a folder without a {inside.name}: name the folder that 'cubicfish "
            "calibrate' wrote, or a camera file"
        )
    return inside


def rig_path(given: Path | None) -> Path | None:
    """The rig's file, where a rig is meant: a rig.yaml, or a folder that has one and no camera."""
    from cubicfish_cli.formats.rig_yaml import is_rig

    if given is None:
        return None
    if given.is_dir():
        inside, camera = given / "rig.yaml", given / DEFAULT_MODEL.name
        return inside if inside.is_file() and not camera.exists() else None
    return given if is_rig(given) else None


def _is_named() -> bool:
    """Whether the command line names the camera, with an option or an argument."""
    named = click.get_current_context().params.get("calibration") is not None
    return named or is_given("model")
