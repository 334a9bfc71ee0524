"""What lies in a calibration's folder already: inputs, and files of an earlier calibration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from cubicfish_cli.cli.report_step import NAME
from cubicfish_cli.cli.terminal import say
from cubicfish_cli.errors import OutputError

# Made by a calibration only, and true of its camera only. A corners.csv may be the user's own.
_ITS_OWN = ("undistort_map.npz", "target.refined.yaml", NAME)


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[Path | None]) -> None:
    """Raise :class:`OutputError` when an input would be replaced, also with --overwrite."""
    inputs = list(inputs)
    for path in outputs:
        if _is_one_of(path, inputs):
            raise OutputError(
                f"{path} would be replaced, and is what this calibration is made from: "
                "choose another folder with -o"
            )


def of_earlier(outputs: Mapping[str, Path], inputs: Iterable[Path | None]) -> list[Path]:
    """Files of an earlier calibration that the new one lacks, and that would seem to be its own.

    Args:
        outputs: what is written; ``camera`` is among it.
        inputs: what the new one is made from, and what stays.

    """
    old = [outputs["camera"].with_name(name) for name in _ITS_OWN]
    inputs = list(inputs)
    return [
        path
        for path in old
        if path not in outputs.values() and path.is_file() and not _is_one_of(path, inputs)
    ]


def say_removed(paths: Iterable[Path]) -> None:
    """Say which of them are gone."""
    for path in paths:
        if not path.exists():
            say(f"removed {path}, which was of an earlier calibration")


def _is_one_of(path: Path, inputs: Iterable[Path | None]) -> bool:
    return any(
        one is not None and one.exists() and path.exists() and path.samefile(one) for one in inputs
    )
