"""Where the program begins: signals and threads are settled before anything else is loaded."""

# Until signals are settled, Ctrl-C shows a traceback: as little as can be is loaded before.
import os
import signal
import sys


def _our_signals() -> list[int]:
    """The signals that end a run and that the parent has not asked to ignore, as nohup does."""
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [int(getattr(signal, name)) for name in names if hasattr(signal, name)]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


def _end_at_once(numbers: list[int]) -> None:
    for number in numbers:
        signal.signal(number, signal.SIG_DFL)


def main() -> None:
    """Run the command line.

    Signals end the process at once, without a word, while there is nothing to clean up: before
    the command line is loaded, and after it has ended. In between they are exceptions.
    """
    numbers = _our_signals()
    _end_at_once(numbers)
    _settle()
    from cubicfish_cli.app.terminal.main import run
    from cubicfish_cli.app.terminal.standard_streams import EXIT_SIGNAL, asked, raise_on

    try:
        try:
            raise_on(numbers)
            sys.exit(run())
        finally:
            _end_at_once(numbers)
    except (Exception, KeyboardInterrupt):
        request = asked()
        if request is None:
            raise
        sys.exit(EXIT_SIGNAL + request)


def _settle() -> None:
    """Threads, bounds, streams and characters, before anything that asks for them is loaded."""
    from cubicfish_cli.app.terminal.standard_streams import settle_streams
    from cubicfish_cli.app.terminal.streams import ERRORS, register

    # The matrices here are small: a second BLAS thread gains nothing, and where other processes
    # run it waits for its turn again and again. Work is shared out by processes instead.
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    # A small file that claims a huge picture is refused by OpenCV, which takes its limit when it is
    # loaded: the one of cubicfish_cli.app.photos.
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "200000000")
    register()
    settle_streams(ERRORS)  # a terminal may lack some characters
