"""The entry point: the group of commands, and the one place where errors become exit codes.

Command modules are imported when they are named, and they import the libraries that do the
work inside their bodies: help and usage errors answer at once.
"""

import signal
import sys
import traceback
from collections.abc import Mapping
from contextlib import suppress
from pkgutil import resolve_name
from typing import Any, NoReturn

import click

from cubicfish import CubicfishError, did_you_mean
from cubicfish_cli import __version__
from cubicfish_cli.terminal.parameters import DEBUG_KEY, common_options, examples
from cubicfish_cli.terminal.start import EXIT_SIGNAL, ending_signal
from cubicfish_cli.terminal.terminal import (
    Failure,
    lead_nowhere,
    print_always,
    print_interrupted,
    safe,
)

EXIT_BROKEN_PIPE = 141  # what a shell reports for a program that SIGPIPE ended

COMMANDS = {
    "target": "commands.target:command",
    "calibrate": "commands.calibrate:command",
    "detect": "commands.detect:command",
    "evaluate": "commands.evaluate:command",
    "compare": "commands.compare:command",
    "info": "commands.info:command",
    "undistort": "commands.undistort:command",
    "map": "commands.map:command",
    "project": "commands.points:project",
    "unproject": "commands.points:unproject",
    "export": "commands.export:command",
    "transform": "commands.transform:command",
}
"""The commands in the order of the work, and where each is."""


class LazyGroup(click.Group):
    """Commands by name, each in its module, which is imported when the command is asked for.

    Args:
        own: name -> ``module:command``.
        of: the group's name, by which extensions add to it; "" for ``cubicfish``.

    """

    def __init__(self, *args: Any, own: Mapping[str, str], of: str = "", **rest: Any) -> None:
        super().__init__(*args, **rest)
        self._own, self._of = own, of

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands' names, in the order of the work."""
        return [*self._own, *self._list_added()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module and return the command."""
        place = self._own.get(cmd_name) or self._list_added().get(cmd_name)
        command: click.Command | None = None if place is None else resolve_name(place)
        return command

    def _list_added(self) -> Mapping[str, str]:
        """List the commands of extensions, which are loaded where none of its own is meant."""
        from cubicfish_cli.extension_table import extension_commands

        return extension_commands(self._of)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest command when there is none of that name."""
        named = args and not args[0].startswith("-") and not ctx.resilient_parsing
        if named and args[0] not in self._own:  # a shell that completes a line is told nothing
            known = self.list_commands(ctx)
            if args[0] not in known:
                ctx.fail(f"No such command {args[0]!r}: {did_you_mean(args[0], known)}")
        return super().resolve_command(ctx, args)


class Program(LazyGroup):
    """All commands; what goes wrong in them is reported in one line."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what a user can cause ends in one line and an exit code."""
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
        except KeyboardInterrupt:
            _end_by_signal()
        except Exception as error:
            if ending_signal() is not None:
                _end_by_signal()
            if isinstance(error, BrokenPipeError):
                # The reader has gone. Python flushes stdout once more on exit.
                lead_nowhere(sys.stdout)
                ctx.exit(EXIT_BROKEN_PIPE)
            why = _explain(error)
            if why is None:
                raise
            if ctx.meta.get(DEBUG_KEY):
                traceback.print_exception(error)
            raise Failure(safe(why)) from error
        return result


def _end_by_signal() -> NoReturn:
    """End as Ctrl-C or another signal has asked for."""
    number = ending_signal() or signal.SIGINT
    if ending_signal() is not None:  # once more ends it at once: all is cleaned up
        signal.signal(number, signal.SIG_DFL)
    if number == signal.SIGINT:
        print_interrupted()
    sys.exit(EXIT_SIGNAL + number)


def _explain(error: Exception) -> str | None:
    """Why the work could not be done, in one line; None where it is no user's doing."""
    if isinstance(error, CubicfishError):
        from cubicfish_cli.words.catalogue import write_error

        return write_error(error)
    if isinstance(error, MemoryError):
        return "not enough memory: use smaller photos or views, or fewer --jobs"
    if isinstance(error, OSError):
        what = error.strerror or str(error)
        return f"{error.filename}: {what}" if error.filename else what
    return None


@common_options
@click.group(
    cls=Program,
    own={name: f"cubicfish_cli.{place}" for name, place in COMMANDS.items()},
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=examples(
        "cubicfish calibrate photos/ --target target.yaml",
        "cubicfish undistort photo.png flat.png",
        "cubicfish calibrate -h",
    ),
)
@click.version_option(__version__, "-V", "--version", prog_name="cubicfish")
def cli() -> None:
    """Calibrate fisheye cameras from photos of checkerboards, and undistort what they see.

    The camera is a ratio of cubic polynomials in the viewing ray (Zhu & Yin, 2010). Results go
    to stdout, everything else to stderr. Exit codes: 0 done, 1 the work could not be done,
    2 wrong usage, 3 done but a --max-rms gate failed, 130 interrupted.
    """


def report_end(error: Exception) -> int:
    """Tell what ended the program before or after its command, and return the exit code."""
    if isinstance(error, click.ClickException):
        # What click says of a command line may repeat a file's name, which may steer a terminal.
        vars(error)["message"] = "\n".join(map(safe, error.message.split("\n")))
        with suppress(OSError):
            error.show()
        return error.exit_code
    if isinstance(error, click.Abort):  # click's word for a signal
        _end_by_signal()
    why = _explain(error)
    if why is None:
        raise error
    if isinstance(error, OSError):  # such as help that cannot be printed
        lead_nowhere(sys.stdout)
    print_always(f"Error: {safe(why)}")
    return 1
