"""The entry point: the group of commands, and the one place where errors become exit codes.

Command modules are imported when they are named, and they import the libraries that do the
work inside their bodies: help and usage errors answer at once.
"""

from __future__ import annotations

import signal
import sys
import traceback
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NoReturn

import click

from cubicfish import CubicfishError, did_you_mean
from cubicfish_cli import __version__
from cubicfish_cli.core_table import COMMANDS, commands_of
from cubicfish_cli.terminal.parameters import DEBUG_KEY, common_options, examples
from cubicfish_cli.terminal.start import EXIT_SIGNAL, ending_signal
from cubicfish_cli.terminal.terminal import (
    Failure,
    lead_nowhere,
    print_always,
    print_interrupted,
    safe,
)

if TYPE_CHECKING:
    from cubicfish_cli.extension_guard import Place

EXIT_BROKEN_PIPE = 141  # what a shell reports for a program that SIGPIPE ended


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
        if cmd_name in self._own:
            command: click.Command = resolve_name(self._own[cmd_name])
            return command
        added = self._list_added().get(cmd_name)
        return None if added is None else added.load_or_leave_out(click.Command)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands, but for those of an extension of which one cannot be loaded."""
        for name in self.list_commands(ctx):
            self.get_command(ctx, name)
        super().format_commands(ctx, formatter)

    def _list_added(self) -> Mapping[str, Place]:
        """List the commands of extensions, which are loaded where none of its own is meant."""
        from cubicfish_cli.extension_guard import extension_commands

        return extension_commands(self._of)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest command when there is none of that name."""
        named = args and not args[0].startswith("-") and not ctx.resilient_parsing
        # A shell that completes a line is told nothing.
        if named and self.get_command(ctx, args[0]) is None:
            near = did_you_mean(args[0], self.list_commands(ctx))
            ctx.fail(f"No such command {args[0]!r}: {near}")
        return super().resolve_command(ctx, args)


class Program(LazyGroup):
    """All commands; what goes wrong in them is reported in one line."""

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run the command line, or help a shell to complete one."""
        from cubicfish_cli.extension_guard import ExtensionWarning

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtensionWarning)  # a shell is told nothing
            return super().main(*args, **extra)

    def make_context(self, *args: Any, **extra: Any) -> click.Context:
        """Begin a command line; an extension that is left out is told in a line of its own."""
        if not extra.get("resilient_parsing"):
            _show_left_out_extensions()
        return super().make_context(*args, **extra)

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
            if _is_debugging():
                traceback.print_exception(error)
            raise Failure(safe(why)) from error
        return result


def _is_debugging() -> bool:
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(DEBUG_KEY))


def _show_left_out_extensions() -> None:
    """Print warnings of extensions as other messages."""
    from cubicfish_cli.extension_guard import ExtensionWarning

    show_others = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if not issubclass(category, ExtensionWarning):
            show_others(message, category, *where, **more)
            return
        print_always(f"warning: {safe(str(message))}")
        if isinstance(message, Warning) and _is_debugging():
            traceback.print_exception(message.__cause__)

    warnings.simplefilter("always", ExtensionWarning)
    warnings.showwarning = show


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
        from cubicfish_cli.words.sentences import render_error

        return render_error(error)
    if isinstance(error, MemoryError):
        return "not enough memory: use smaller photos or views, or fewer --jobs"
    if isinstance(error, OSError):
        what = error.strerror or str(error)
        return f"{error.filename}: {what}" if error.filename else what
    return None


@common_options
@click.group(
    cls=Program,
    own=commands_of(COMMANDS, ""),
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
