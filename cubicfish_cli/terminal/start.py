"""Where the program begins, and how a signal ends it: settled before anything else is loaded."""

# Until signals are settled, Ctrl-C shows a traceback: as little as can be is loaded before.
from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from sys import UnraisableHookArgs
    from types import FrameType
    from typing import NoReturn

EXIT_SIGNAL = 128  # and the signal's number, as shells count

_ending_signal: int | None = None
# A request that was lost is made again after so many seconds.
_AGAIN = 0.01


def main() -> None:
    """Run the command line.

    Signals end the process at once, without a word, while there is nothing to clean up: before
    the command line is loaded, and after it has ended. In between they are exceptions.
    """
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [int(getattr(signal, name)) for name in names if hasattr(signal, name)]
    # The parent may have asked to ignore some, as nohup does.
    numbers = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
    _set_handler(numbers, signal.SIG_DFL)
    prepare_process()
    from cubicfish_cli.terminal.main import cli, report_end

    try:
        try:
            sys.unraisablehook = _interrupt_again
            _set_handler(numbers, _interrupt)
            code = cli.main(prog_name="cubicfish", standalone_mode=False)
            sys.exit(code if isinstance(code, int) else 0)
        except Exception as error:
            sys.exit(report_end(error))
        finally:
            _set_handler(numbers, signal.SIG_DFL)
    except (Exception, KeyboardInterrupt):
        if _ending_signal is None:
            raise
        sys.exit(EXIT_SIGNAL + _ending_signal)


def prepare_process() -> None:
    """Settle threads, bounds, streams and characters, before what asks for them is loaded."""
    # The matrices here are small: a second BLAS thread gains nothing, and where other processes
    # run it waits for its turn again and again. Work is shared out by processes instead.
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    # What goes wrong is told by the program, in a line.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # A small file that claims a huge picture is refused by OpenCV, which takes its limit when it is
    # loaded: the one of cubicfish.photos.photos.
    most = os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "200000000")
    if not (most.isascii() and most.isdecimal()):  # OpenCV would abort the process
        sys.exit(
            f"Error: OPENCV_IO_MAX_IMAGE_PIXELS is {most!r} in the environment, "
            "and must be a whole number of pixels: correct it, or unset it"
        )
    from cubicfish_cli.terminal.terminal import open_closed_streams

    open_closed_streams()


class Interrupted(KeyboardInterrupt):
    """A signal asks for the end: a KeyboardInterrupt of another class is nobody's request."""


def ending_signal() -> int | None:
    """The signal that has asked for the end; None where none has.

    An exception may be another one's cause when it arrives, as while Python 3.11 makes a class.
    """
    return _ending_signal


def _set_handler(numbers: list[int], how: signal._HANDLER) -> None:
    for number in numbers:
        signal.signal(number, how)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:
    global _ending_signal
    _ending_signal = number
    raise Interrupted


def _interrupt_again(what: UnraisableHookArgs) -> None:
    """Where an exception goes nowhere, as in a finaliser, the request comes once more.

    What else finalisers say of work that was broken off is of no use to anybody.
    """
    if _ending_signal is None:
        sys.__unraisablehook__(what)
    elif isinstance(what.exc_value, KeyboardInterrupt):
        import threading

        again = threading.Timer(_AGAIN, os.kill, (os.getpid(), _ending_signal))
        again.daemon = True
        again.start()
