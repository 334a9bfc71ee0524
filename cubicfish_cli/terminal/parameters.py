"""Options that several commands share, each defined once."""

from __future__ import annotations

import functools
import math
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from glob import glob
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

import click
from click.core import ParameterSource

from cubicfish import CameraFileError, CubicfishError, UsageError, did_you_mean, quoted
from cubicfish.arguments import refuse_misfit
from cubicfish_cli.inputs.paths import in_folder
from cubicfish_cli.words.phrases import shell_line

if TYPE_CHECKING:
    from cubicfish_cli.inputs.target_source import TargetSource


class FloatRange(click.FloatRange):
    """A finite number within bounds."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Parse, or fail as a usage error."""
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not finite.", param, ctx)
        return number


AnyCommand = TypeVar("AnyCommand", bound=click.Command)

Kind = TypeVar("Kind")

_OPTIONS = "options"
_CHANGES_NO_CAMERA = {
    "as_json", "folder", "jobs", "max_rms", "no_cache", "output", "overwrite", "report",
}  # fmt: skip
CAMERA_KEY = "cubicfish.camera"
DEBUG_KEY = "cubicfish.debug"
VERBOSITY_KEY = "cubicfish.verbosity"
DEFAULT_MODEL = Path("calibration") / "camera.yaml"
DEFAULT_TARGET = Path("target.yaml")

FILE = click.Path(path_type=Path)
_ENDS_OF_FILES = {
    ".csv", ".html", ".jpg", ".json", ".npz", ".pdf", ".png", ".svg", ".yaml", ".yml", ".zip",
}  # fmt: skip


class OutputPath(click.Path):
    """The name of a file or a folder to write; one that looks like the other is refused."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse the other's name."""
        path, text = Path(value), quoted(str(value))
        if not self.file_okay and path.suffix.lower() in _ENDS_OF_FILES and not path.is_dir():
            self.fail(
                f"{text} is the name of a file, and several files are written: name their folder, "
                f"such as {quoted(str(path.with_suffix('')))}",
                param,
                ctx,
            )
        if self.file_okay and str(value).endswith(("/", os.sep)):
            self.fail(f"{text} is a folder: give the name of a file", param, ctx)
        return super().convert(value, param, ctx)


OUTPUT = OutputPath(path_type=Path)
FOLDER = OutputPath(path_type=Path, file_okay=False)

NAME = click.Path(readable=False)
"""The name of a file or several, as text: what it means is found out where it is used."""


class Argument(click.Argument):
    """An argument with a meaning, in a few words, for the reference page docs/cli.md.

    ``--help`` says it in the command's description.
    """

    def __init__(self, *args: Any, meaning: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.meaning = meaning

    def process_value(self, ctx: click.Context, value: Any) -> Any:
        """Click's, after a look for names that a space has split.

        What click misses here of two arguments is the last: it gives the only word to that one.
        """
        words = value if isinstance(value, tuple) else ()
        for first, second in pairwise(words):
            whole = f"{first} {second}"
            if not os.path.lexists(first) and (os.path.lexists(whole) or glob(whole)):
                raise click.UsageError(
                    f"{first} does not exist, {quoted(whole)} does: put quotes round a name that "
                    "has spaces",
                    ctx,
                )
        try:
            return super().process_value(ctx, value)
        except click.MissingParameter as problem:
            if self.nargs == -1:
                arguments = [one for one in ctx.command.params if isinstance(one, Argument)]
                problem.param = arguments[-1]
            raise


@dataclass(frozen=True, kw_only=True)
class Option:
    """What a field of a record is on the command line.

    Attributes:
        make: makes click's parameter of a name.
        default: the field's value where a program does not say.
        is_required: whether a program must say.

    """

    make: Callable[[str], click.Parameter]
    default: Any = None
    is_required: bool = False

    def parameters(self, name: str) -> list[click.Parameter]:
        """Click's."""
        return [self.make(name)]

    def value(self, name: str, values: Mapping[str, Any]) -> Any:
        """What the field is where click has these values by their names."""
        return values[name]


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """Several options that make one field of a record together.

    Attributes:
        kind: makes the field's value of theirs, by the names in ``fields``.
        fields: the options.
        default: the field's value where a program does not say.
        is_required: whether a program must say.

    """

    kind: Callable[..., Any]
    fields: Mapping[str, Option | Bundle]
    default: Any = None
    is_required: bool = False

    def parameters(self, name: str = "") -> list[click.Parameter]:
        """Click's, of all of them."""
        return [own for one, field in self.fields.items() for own in field.parameters(one)]

    def value(self, name: str, values: Mapping[str, Any]) -> Any:
        """What the field is where click has these values by their names."""
        return self.kind(**{one: field.value(one, values) for one, field in self.fields.items()})


def argument(meaning: str, *, type: click.ParamType = FILE, **more: Any) -> Any:
    """An argument of a record, by default the name of a file; ``more`` as click has it."""

    def make(name: str) -> click.Parameter:
        return Argument([name], type=type, meaning=meaning, **more)

    several = more.get("nargs") == -1
    needed = more.get("required", not several and "default" not in more)
    default = more.get("default", () if several else None)
    return Option(make=make, default=default, is_required=needed)


class Choice(click.Choice):  # type: ignore[type-arg, unused-ignore]
    """One of some words; for another one the nearest is proposed."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """As click does."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            near = did_you_mean(str(value), map(str, self.choices))
            self.fail(f"{quoted(str(value))} is not one of them: {near}", param, ctx)


class Command(click.Command):
    """A command that proposes an option only where its word is near."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does, which takes the dashes for a part of the word."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as problem:
            known = {word.lstrip("-"): word for one in self.params for word in one.opts}
            word = problem.option_name.lstrip("-")
            near = [known[one] for one in get_close_matches(word, known)]
            raise click.NoSuchOption(
                problem.option_name, possibilities=near, ctx=problem.ctx
            ) from problem


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


def _read_length(text: str) -> str:
    """A length with its unit, as text; that one without is in millimetres is said."""
    from cubicfish_cli.terminal.terminal import print_message

    if text.strip()[-1:].isdigit():
        print_message(f"note: {text} has no unit and is taken as millimetres")
    return text


LENGTH = Parsed("length", _read_length)


def _read_seconds(text: str) -> float:
    found = re.fullmatch(r"([0-9]*\.?[0-9]+) *(us|ms|s)", text.strip())
    if found is None or not float(found[1]) > 0:
        raise ValueError(f"{quoted(text)} is no time: write 5ms, 200us or 0.01s")
    return float(found[1]) * {"us": 1e-6, "ms": 1e-3, "s": 1.0}[found[2]]


SECONDS = Parsed("time", _read_seconds)
"""A length of time with its unit, such as 5ms, as seconds."""


def examples(*lines: str) -> str:
    """An epilog that shows command lines as they are."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def as_command(
    name: str,
    short_help: str,
    *lines: str,
    do: Callable[..., Any],
    how: Sequence[str] = (),
    **more: Any,
) -> Callable[[Callable[..., None]], click.Command]:
    """Make a command of a function that prints what was made.

    It takes what ``do`` made; ``given``, the record whose class says the command's options; and
    ``how``, which has some more.

    Args:
        name: of the command.
        short_help: what it is for, in the list of commands.
        lines: command lines that show it at work.
        do: does the work: takes the record and, as ``run``, how, and returns what it made.
        how: the options of ``how`` that the command has.
        more: as click has it.

    """

    def decorate(show: Callable[..., None]) -> click.Command:
        known = vars(sys.modules[show.__module__])
        kinds = [known[show.__annotations__[to]] for to in ("given", "how")]
        options, ways = (Bundle(kind=kind, fields=getattr(kind, _OPTIONS)) for kind in kinds)
        ways = replace(ways, fields={one: ways.fields[one] for one in how})

        @functools.wraps(show)
        def command(**values: Any) -> None:
            try:
                # What is wrong with this is known before any file is looked for.
                way = ways.value("how", values)
                given = options.value("given", values)
                with way.run() as run:
                    made = do(given, run=run)
                show(made, given, way)
            except UsageError as problem:
                from cubicfish_cli.words.sentences import render_error

                raise click.UsageError(render_error(problem)) from problem

        params = options.parameters() + ways.parameters()
        shown = {"cls": Command, "short_help": short_help, "epilog": examples(*lines), **more}
        made = common_options(click.command(name, params=params, **shown)(command))
        vars(made)["do"] = do  # whose result says what --json prints
        return made

    return decorate


def _saying_what_misfits(kind: type) -> Callable[[Any], None]:
    """A record's own check, in which a field of another kind may end in any error of Python's."""
    check: Callable[[Any], None] = vars(kind)["__post_init__"]

    def check_or_explain(made: Any) -> None:
        try:
            check(made)
        except CubicfishError:
            raise
        except (AttributeError, TypeError, ValueError, DeprecationWarning):
            # Of an empty array in a condition older numpy only warns.
            refuse_misfit(kind.__name__, made, kind)
            raise

    return check_or_explain


@dataclass_transform(kw_only_default=True, frozen_default=True)
def record(kind: type[Kind]) -> type[Kind]:
    """A frozen record of options: each field is one, or has a plain default."""
    given = {name: vars(kind).get(name) for name in kind.__annotations__}
    options = {name: one for name, one in given.items() if isinstance(one, Option | Bundle)}
    for name, one in options.items():
        if one.is_required:
            delattr(kind, name)
        else:
            setattr(kind, name, one.default)
    checked: Any = kind
    checked.checked_fields = True
    if "__post_init__" in vars(kind):
        checked.__post_init__ = _saying_what_misfits(kind)
    setattr(kind, _OPTIONS, {**getattr(kind, _OPTIONS, {}), **options})
    return dataclass(frozen=True, kw_only=True)(kind)


def bundle(kind: Callable[..., Any], /, *, needed: bool = False, **options: Any) -> Any:
    """Options that come together as one field of a record.

    Args:
        kind: a :func:`record`, or what makes one of the options' values by their names.
        needed: whether a program must give the field.
        options: of what is no record, in the order of ``--help``.

    """
    default = kind() if isinstance(kind, type) and not needed else None
    fields = options or getattr(kind, _OPTIONS)
    return Bundle(kind=kind, fields=fields, default=default, is_required=needed)


def option(words: str, help: str, type: Any = None, default: Any = None, **more: Any) -> Any:
    """An option of a record, whose default its help shows.

    Args:
        words: its names, and what its value is called: ``-n --number N``; a flag has no value.
        help: what it is for.
        type: of its value; without one, and without a name of the value, it is a flag.
        default: where it is not given.
        more: as click has it.

    """
    names = words.split()
    unsaid = default
    if not names[-1].startswith("-"):
        more["metavar"] = names.pop()
    elif type is None:
        more["is_flag"] = True
        unsaid = bool(default)
    if default is not None:
        more = {"default": default, "show_default": True, **more}

    def make(name: str) -> click.Parameter:
        return click.Option([*names, name], type=type, help=help, **more)

    several, needed = more.get("multiple", False), more.get("required", False)
    return Option(make=make, default=() if several else unsaid, is_required=needed)


def _make_callback(
    key: str, value: int | bool
) -> Callable[[click.Context, click.Parameter, bool], None]:
    def callback(ctx: click.Context, _: click.Parameter, given: bool) -> None:
        if given:
            ctx.meta[key] = value

    return callback


def common_options(command: AnyCommand) -> AnyCommand:
    """``-v``, ``-q`` and ``--debug``; they may stand before or after the command's name."""
    common = [
        option(
            words, help, expose_value=False, is_eager=True, callback=_make_callback(key, value)
        ).make(to)
        for key, value, words, to, help in (
            (VERBOSITY_KEY, 1, "-v --verbose", "verbose", "Verbose output."),
            (VERBOSITY_KEY, -1, "-q --quiet", "quiet", "Print only results and errors."),
            (DEBUG_KEY, True, "--debug", "debug", "Show the traceback of an error."),
        )
    ]
    command.params = [*common, *command.params]
    return command


def is_given(parameter: str) -> bool:
    """Whether the command line gives this parameter of the command, and not a default."""
    source = click.get_current_context().get_parameter_source(parameter)
    return source is ParameterSource.COMMANDLINE


def command_line() -> str:
    """The command that is being run, without what is by default and what changes no camera."""
    context = click.get_current_context()
    words = context.command_path.split()
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(parameter, click.Argument):
            words += map(str, value if isinstance(value, tuple) else [value])
        elif _makes_the_camera(context, parameter):
            words += _written_option(parameter, value)
    return shell_line(*words)


def _makes_the_camera(context: click.Context, parameter: click.Parameter) -> bool:
    """Whether an option is given, and is one that changes what comes out."""
    name = parameter.name or ""
    given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
    return given and name in context.params and name not in _CHANGES_NO_CAMERA


def _written_option(parameter: click.Parameter, value: Any) -> list[str]:
    """The words that give an option a value."""
    names = parameter.secondary_opts if value is False else parameter.opts
    name = max(names or parameter.opts, key=len)
    if isinstance(value, bool):
        return [name]
    if isinstance(parameter, click.Option) and parameter.multiple:
        return [word for one in value or () for word in (name, str(one))]
    return [name, "x".join(map(str, value)) if isinstance(value, tuple) else str(value)]


def verbosity() -> int:
    """-1 after ``--quiet``, 1 after ``--verbose``, else 0."""
    value: int = click.get_current_context().meta.get(VERBOSITY_KEY, 0)
    return value


target_option = option(
    "-t --target FILE",
    "The calibration target: a target.yaml, or a target file of Kalibr's. [default: ./target.yaml, "
    "if it is there]",
    FILE,
)


def _read_counts(text: str) -> tuple[int, int]:
    """``9x6`` -> (9, 6)."""
    match = re.fullmatch(r"\s*([0-9]{1,3})\s*[xX×]\s*([0-9]{1,3})\s*", text)
    columns, rows = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (2 <= columns <= 100 and 2 <= rows <= 100):
        raise ValueError(f"{text!r} is not two numbers from 2 to 100, such as 9x6")
    return columns, rows


COUNTS = Parsed("COLUMNSxROWS", _read_counts)


def _choose_target(
    target: Path | None, board: tuple[int, int] | None, square: str | None
) -> TargetSource:
    from cubicfish_cli.inputs.target_source import TargetSource, length_mm

    if board is None:
        if square is not None:
            raise click.UsageError("--square is of --board: add --board 9x6 (inner corners)")
        return TargetSource(path=target_path(target), by_default=target is None)
    if target is not None:
        raise click.UsageError("--target says what the target is: leave --board out, or --target")
    if square is None:
        raise click.UsageError("--board needs the side of its squares: add --square 25mm")
    return TargetSource(counts=board, square=length_mm(square))


report_option = option(
    "--report/--no-report",
    "Also write report.html, a page about the calibration. It takes a second or two, and needs the "
    "extra 'report'.",
    default=True,
)

target_options = bundle(
    _choose_target,
    target=target_option,
    board=option(
        "--board",
        "Instead of a target.yaml: one flat checkerboard with so many inner corners (squares less "
        "one), such as 9x6.",
        COUNTS,
    ),
    square=option("--square LENGTH", "Side of the squares of --board: 30mm, 3cm, 1.25in.", LENGTH),
)
"""``--target``, or ``--board`` and ``--square``: one :class:`TargetSource` as ``target``."""


def target_path(given: Path | None) -> Path | None:
    """The file that was named, else ./target.yaml; None where it is not there."""
    return given or (DEFAULT_TARGET if DEFAULT_TARGET.is_file() else None)


def _need_target(target: Path | None) -> Path:
    path = target_path(target)
    if path is None:
        raise UsageError(
            "name the calibration target with --target target.yaml: there is no ./target.yaml, and "
            "'cubicfish target print' makes one"
        )
    if target is None:
        from cubicfish_cli.terminal.terminal import print_message

        print_message(f"Target: {path}.")
    return path


needed_target = bundle(_need_target, needed=True, target=target_option)
"""``--target`` of commands that need one: the path of its file, by default ./target.yaml."""


model_option = option(
    "-m --model FILE",
    "The camera: its file, or the folder that calibrate wrote. [default: "
    "$CUBICFISH_MODEL, else calibration/camera.yaml]",
    FILE,
    envvar="CUBICFISH_MODEL",
)

calibration_argument = argument(
    "The folder that calibrate wrote, or the camera's file in it. [default: --model]",
    required=False,
    metavar="[FOLDER|CAMERA_YAML]",
)


def model_path(model: Path | None, calibration: Path | None = None) -> Path:
    """The camera file to read: the one that was given, else the default one if it is there.

    A folder stands for the camera.yaml in it. A camera that was not named on the command line is
    named on stderr when the work begins.

    Raises:
        UsageError: two were given.
        CameraFileError: nothing was given and the default is not there.

    """
    if calibration is not None and is_given("model"):
        raise UsageError(
            f"--model names a camera, and so does {quoted(str(calibration))}: leave one of them out"
        )
    path = calibration or model or DEFAULT_MODEL
    if path is DEFAULT_MODEL and not path.exists():
        raise CameraFileError(
            f"there is no {DEFAULT_MODEL} here: run 'cubicfish calibrate' first, "
            "or name a camera with --model or $CUBICFISH_MODEL"
        )
    path = in_folder(path)
    if calibration is None and not is_given("model"):
        click.get_current_context().meta[CAMERA_KEY] = path
    return path


camera_options = bundle(
    model_path, needed=True, calibration=calibration_argument, model=model_option
)
"""``FOLDER`` or ``--model``: the path of the camera's file."""

model_options = bundle(model_path, needed=True, model=model_option)
"""``--model``: the path of the camera's file."""


def output_option(
    help: str,
    default: str | None = None,
    *,
    folder: bool | None = False,
    metavar: str = "",
    **more: Any,
) -> Any:
    """``-o``, which says where the result goes; ``folder`` is None where it may be either."""
    words = metavar or ("FOLDER" if folder else "FILE")
    kind = FILE if folder is None else FOLDER if folder else OUTPUT
    return option(f"-o --output {words}", help, kind, default, **more)


exclude_option = option(
    "--exclude PHOTO",
    "Leave this photo out, or those of a pattern such as 'blurred_*'; may be repeated.",
    str,
    multiple=True,
)

json_option = option("--json", "Print one JSON object to stdout, and nothing else.")


overwrite_option = option("--overwrite", "Replace files that exist.")

jobs_option = option(
    "-j --jobs N",
    "Photos to work on at a time. [default: the number of processors]",
    click.IntRange(min=1),
)

no_cache_option = option(
    "--no-cache",
    "Search every photo anew. Otherwise ~/.cache/cubicfish (or the folder that CUBICFISH_CACHE "
    "names) keeps what was found in a photo until the photo changes.",
)

max_rms_option = option(
    "--max-rms PX",
    "Exit with 3 if the RMS is above this. All outputs are written in any case.",
    FloatRange(min=0, min_open=True),
)


def refine_target_option(help: str) -> Any:
    """``--refine-target``: how far the target is fitted too."""
    return option("--refine-target", help, Choice(["off", "shape", "points", "auto"]))


_MAX_SIDE = 100_000


def _read_size(text: str) -> tuple[int, int]:
    """``1280x800`` -> (1280, 800)."""
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*[xX×]\s*([0-9]{1,6})\s*", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 0 < min(size) <= max(size) <= _MAX_SIDE:
        raise UsageError(
            f"{quoted(text)} is not an image size: write WIDTHxHEIGHT, such as 1280x800"
        )
    return size


SIZE = Parsed("WIDTHxHEIGHT", _read_size)

size_option = option("--size", "Size of the photos, for a CSV file that does not state it.", SIZE)
