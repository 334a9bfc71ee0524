"""The entry point: the group of commands, and the one place where errors become exit codes.

Command modules are imported when they are named, and they import the libraries that do the
work inside their bodies: help and usage errors answer at once.
"""

from __future__ import annotations

import importlib
import io
import os
import signal
import sys
from types import FrameType
from typing import Any, NoReturn

import click

from cubicfish_cli import __version__
from cubicfish_cli.cli.options import DEBUG_KEY, common_options
from cubicfish_cli.errors import CubicfishError
from cubicfish_cli.wording import did_you_mean

EXIT_INTERRUPTED = 130
EXIT_SIGNAL = 128  # and the signal's number, as shells count
EXIT_BROKEN_PIPE = 141  # what a shell reports for a program that SIGPIPE ended

COMMANDS = (
    "target",
    "calibrate",
    "detect",
    "evaluate",
    "compare",
    "undistort",
    "map",
    "project",
    "unproject",
)


class Terminated(KeyboardInterrupt):
    """A request to end (SIGTERM, SIGHUP), to be cleaned up after like Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise Terminated(number)


class LazyGroup(click.Group):
    """Commands by name, each in the module of the same name, imported when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands' names, in the order of the work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module and return its ``command``."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"cubicfish_cli.cli.{cmd_name}")
        command: click.Command = module.command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest command when there is none of that name."""
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            ctx.fail(f"No such command {args[0]!r}: {did_you_mean(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what a user can cause ends in one line and an exit code."""
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
        except CubicfishError as error:
            if ctx.meta.get(DEBUG_KEY):
                raise
            raise click.ClickException(str(error)) from error
        except Terminated as request:
            ctx.exit(EXIT_SIGNAL + request.number)
        except KeyboardInterrupt:
            click.echo("Interrupted.", err=True)
            ctx.exit(EXIT_INTERRUPTED)
        except BrokenPipeError:
            # The reader has gone. Python flushes stdout once more on exit: give it a place to go.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(EXIT_BROKEN_PIPE)
        except MemoryError as error:
            if ctx.meta.get(DEBUG_KEY):
                raise
            raise click.ClickException(
                "not enough memory: use smaller photos or views, or fewer --jobs"
            ) from error
        except OSError as error:
            if ctx.meta.get(DEBUG_KEY):
                raise
            what = error.strerror or str(error)
            where = f"{error.filename}: " if error.filename else ""
            raise click.ClickException(f"{where}{what}") from error
        return result


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Start with: cubicfish calibrate PHOTOS --target target.yaml",
)
@click.version_option(__version__, "-V", "--version", prog_name="cubicfish")
@common_options
def cli() -> None:
    """Calibrate fisheye cameras from photos of checkerboards, and undistort what they see.

    The camera is a ratio of cubic polynomials in the viewing ray (Zhu & Yin, 2010). Results go
    to stdout, everything else to stderr. Exit codes: 0 done, 1 the work could not be done,
    2 wrong usage, 3 done but a --max-rms gate failed, 130 interrupted.
    """


def main() -> None:
    """Run the command line."""
    # The matrices here are small: a second BLAS thread gains nothing, and where other processes
    # run it waits for its turn again and again. Work is shared out by processes instead.
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    # Without a handler these end the process on the spot, and temporary files stay behind.
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # A parent such as nohup has asked for the signal to be ignored.
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _terminate)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may lack some characters
            stream.reconfigure(errors="backslashreplace")
    cli(prog_name="cubicfish")


if __name__ == "__main__":
    main()
