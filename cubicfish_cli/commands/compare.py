"""``cubicfish compare``: how far apart two cameras are, in pixels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run, UsageError
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import in_folder, path_or_none
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import enforce_max_rms, print_figure, print_spread, px
from cubicfish_cli.terminal.parameters import as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_table, result

if TYPE_CHECKING:
    from cubicfish import Comparison

_DRAWN_PIXELS = 150_000


@record
class CompareOptions:
    """Options of :func:`compare_files`.

    Attributes:
        first: file or folder of a camera; differences are in its pixels.
        second: file or folder of the other camera.
        picture: also draw the difference at every pixel of the first camera into this file.

    """

    first: StrPath = parameters.argument(
        "The camera.yaml, or its folder, in whose pixels differences are.", metavar="A"
    )
    second: StrPath = parameters.argument(
        "The camera.yaml, or its folder, that is compared with it.", metavar="B"
    )
    picture: StrPath | None = option(
        "--picture FILE", "Also draw the difference at every pixel of camera A.", parameters.FILE
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedFiles:
    """Result of :func:`compare_files`.

    Attributes:
        comparison: how far apart the cameras are.
        picture: the file of the picture; None without one.

    """

    comparison: Comparison
    picture: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish compare --json`` prints.

        Keys:
            rms_px: sqrt(mean(dx² + dy²)) over pixels of the common field
            median_px: the median difference
            p95_px: 95 % of the differences are below this
            max_px: the largest difference
            pixels: at how many pixels this was measured
            common_share: share of what A sees that B sees too
            rotation_deg: the rotation that was taken out
            scale: A's pixels for one of B's
            by_angle: a record a ring about the axis: from_deg, to_deg, rms_px, max_px, pixels
            picture: the file of --picture, where it was asked for

        """
        drawn = {} if self.picture is None else {"picture": self.picture}
        return {**self.comparison.as_record(), **drawn}


def compare_files(options: CompareOptions, *, run: Run = Run()) -> ComparedFiles:
    """Measure how far apart two cameras see the same rays, as ``cubicfish compare`` does.

    Raises:
        UsageError: ``overwrite`` is set though no file is written.
        CameraFileError: a file cannot be used.
        FitError: the cameras have no field in common.
        OutputError: the picture exists and may not be replaced, or cannot be written.

    """
    from cubicfish import compare
    from cubicfish.io import read_camera
    from cubicfish_cli.undistortion.images import check_suffix, write_picture

    path = path_or_none(options.picture)
    paths = [in_folder(Path(given)) for given in (options.first, options.second)]
    if path is not None:
        Plan(run).reads(paths).writes(path)
        check_suffix(path)
    elif run.overwrite:
        raise UsageError("--overwrite goes with --picture, which writes a file: leave it out")
    comparison = compare(*map(read_camera, paths))
    if path is not None:
        write_picture(path, _draw_picture(comparison), overwrite=run.overwrite)
    return ComparedFiles(comparison=comparison, picture=path)


def _draw_picture(comparison: Comparison) -> Any:
    """Draw the length of the difference at every pixel of the first camera, in colours."""
    import numpy as np

    from cubicfish_cli.render.difference_picture import difference_picture

    width, height = comparison.first.image_size
    # Differences are smooth: one per small block is enough.
    step = max(1, round((width * height / _DRAWN_PIXELS) ** 0.5))
    y, x = np.mgrid[:height:step, :width:step] + (step - 1) / 2
    coarse = np.linalg.norm(comparison.difference(np.stack([x, y], axis=-1)), axis=-1)
    return difference_picture(np.kron(coarse, np.ones((step, step)))[:height, :width])


@as_command(
    "compare",
    "Compare two cameras, in pixels.",
    "cubicfish compare last_year/camera.yaml calibration/camera.yaml",
    "cubicfish compare a.yaml b.yaml --picture difference.png --max-rms 0.3",
    "cubicfish compare simulated/true_camera.yaml calibration/camera.yaml",
    do=compare_files,
    how=("max_rms", "overwrite", "as_json"),
)
def command(made: ComparedFiles, given: CompareOptions, how: How) -> None:
    """Measure how many pixels apart the cameras A and B see the same rays, over their common field.

    A and B are camera.yaml files, such as the true_camera.yaml that simulate writes beside its
    photos. The rotation between the two camera frames that makes the differences smallest is taken
    out first, since poses absorb it. Both cameras have photos of the same size, or of sizes that
    are an exact rescale; differences are in A's pixels.
    """
    if not how.print(made):
        _print(made.comparison)
        if made.picture is not None:
            result(f"\nwrote {made.picture}")
    enforce_max_rms(made.comparison.statistics.rms_px, how.max_rms)


def _print(comparison: Comparison) -> None:
    record, spread = comparison.as_record(), comparison.statistics
    meaning = "sqrt(mean(dx² + dy²)) over pixels"
    print_figure("RMS difference", px(spread.rms_px), meaning=meaning)
    print_spread(spread)
    share = 100 * record["common_share"]
    print_figure("common field", f"{share:.1f}", "%", "of what A sees")
    result(f"{'rotation taken out':<24}{record['rotation_deg']:>7.3f}°")
    if record["scale"] != 1:
        result(f"{'scale taken out':<24}{record['scale']:>7.3f}    A's pixels for one of B's")
    result()
    print_table(
        ("from °", "to °", "rms px", "largest"),
        [
            (
                f"{ring['from_deg']:.0f}",
                f"{ring['to_deg']:.0f}",
                px(ring["rms_px"]),
                px(ring["max_px"]),
            )
            for ring in record["by_angle"]
        ],
    )
