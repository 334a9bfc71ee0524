"""``cubicfish rig compare``: how far apart two rigs are, camera by camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import px
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_table, result

if TYPE_CHECKING:
    from cubicfish.rigs import ComparedCamera


@record
class RigCompareOptions:
    """Two rigs that are compared.

    Attributes:
        first: the rig.yaml of one, or the folder of that.
        second: another one, whose cameras have the same names.

    """

    first: StrPath = parameters.argument(
        "The rig.yaml, or its folder, in whose frame differences are.", metavar="A"
    )
    second: StrPath = parameters.argument(
        "The rig.yaml, or its folder, that is compared with it.", metavar="B"
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedRigFiles:
    """What became of :func:`compare_rig_files`.

    Attributes:
        units: of lengths; None where not known.
        cameras: how far apart the cameras of one name stand, and their lenses are.

    """

    units: str | None
    cameras: Sequence[ComparedCamera]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig compare --json`` prints.

        Keys:
            units: of lengths
            cameras: a record per camera: name, shift and turn_deg beside the first camera,
                shift_sigma, turn_sigma_deg, sigmas (all of it over its standard deviations) and
                lens (with the keys of 'cubicfish compare')

        """
        return {"units": self.units, "cameras": [one.as_record() for one in self.cameras]}


def compare_rig_files(options: RigCompareOptions, *, run: Run = Run()) -> ComparedRigFiles:
    """Say how far apart two rigs are, camera by camera, as ``cubicfish rig compare`` does.

    Raises:
        CameraFileError: a file cannot be used.
        FitError: the rigs have fewer than two cameras in common, or other units.

    """
    from cubicfish import compare_rigs, load_rig

    rig = load_rig(options.first)
    return ComparedRigFiles(units=rig.units, cameras=compare_rigs(rig, load_rig(options.second)))


@as_command(
    "compare",
    "Compare two rigs, camera by camera.",
    "cubicfish rig compare last_year/rig.yaml rig/rig.yaml",
    "cubicfish rig compare last_year rig --json",
    do=compare_rig_files,
    how=("as_json",),
)
def command(made: ComparedRigFiles, given: RigCompareOptions, how: How) -> None:
    """Say how far cameras have moved from rig A to rig B, relative to the first camera.

    Cameras are matched by their names. Differences have their standard deviation, and lenses are
    compared too.
    """
    if not how.print(made):
        _print_compared(made)


def _print_compared(made: ComparedRigFiles) -> None:
    found, units = made.cameras, f" {made.units}" if made.units else ""
    print_table(
        ("camera", f"shift{units}", "± shift", "turned °", "± turn °", "in σ", "lens RMS px"),
        [
            (
                one.name,
                f"{float((one.shift**2).sum()) ** 0.5:.3f}",
                _write_sigma(one.shift_sigma, 3),
                f"{one.turn_deg:.4f}",
                _write_sigma(one.turn_sigma_deg, 4),
                _write_sigma(one.sigmas, 1),
                px(one.lens.statistics.rms_px),
            )
            for one in found
        ],
    )
    result(
        f"\nPlaces are beside {found[0].name}, of the rays of the same pixels; ± is of both rigs "
        "together.\nDifferences of up to about 2 σ are what two calibrations of one rig have."
    )


def _write_sigma(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
