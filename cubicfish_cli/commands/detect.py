"""``cubicfish detect``: find and name the corners, and stop there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import named_photos, path_or_none, paths_of
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import figures, parameters
from cubicfish_cli.terminal.parameters import as_command, option, record, target_options
from cubicfish_cli.terminal.progress import How, report_found
from cubicfish_cli.terminal.terminal import print_message, result
from cubicfish_cli.words.phrases import plural
from cubicfish_cli.words.sentences import record_of, render

if TYPE_CHECKING:
    from cubicfish import Detection, Target


@record
class DetectOptions:
    """Options of :func:`detect_files`.

    Attributes:
        photos: files, folders and globs.
        target: the calibration target, or its file.
        table: the corners.csv to write.
        exclude: photos that are left out, by their names or by patterns.
        draw: a folder for a picture of what was found in each photo that could be read.

    """

    photos: StrPath | Sequence[StrPath] = parameters.argument(
        "Photos: files, folders or globs.", nargs=-1, required=True, metavar="PHOTOS..."
    )
    target: TargetSource | Target | StrPath | None = target_options
    table: StrPath = parameters.output_option("Where the corners go.", default="corners.csv")
    exclude: StrPath | Sequence[StrPath] = parameters.exclude_option
    draw: StrPath | None = option(
        "--draw FOLDER",
        "Also write FOLDER/<photo>.png for each photo: the corners of each board in a colour of "
        "its own, a disc at corner (0, 0), arrows along x and y, and in red what was left out and "
        "why.",
        parameters.FOLDER,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class DetectedFiles:
    """Result of :func:`detect_files`.

    Attributes:
        detection: the corners, and the findings about each photo.
        file: the table of corners.
        drawings: pictures of what was found; None without ``draw``.

    """

    detection: Detection
    file: Path
    drawings: list[Path] | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish detect --json`` prints.

        Keys:
            file: the table of corners
            image_size: [width, height]
            images: how many photos have corners
            corners: how many corners were found
            findings: what looks wrong with the set-up, a record each
            per_image: a record per photo: image, boards, corners, added (by the second look),
                exact (whether names are certain), problem, notes, findings
            drawings: the pictures that --draw wrote

        """
        from cubicfish_cli.words.remarks import problem_of

        keys = ("boards", "corners", "added", "exact")
        corners = self.detection.corners
        return {
            "file": self.file,
            "image_size": corners.image_size,
            "images": len(corners.images),
            "corners": len(corners.pixel),
            "findings": [record_of(finding) for finding in self.detection.findings],
            "per_image": [
                {
                    "image": photo.name,
                    **{key: getattr(photo, key) for key in keys},
                    "problem": problem_of(photo),
                    "notes": [render(one).line for one in photo.remarks],
                    "findings": [record_of(finding) for finding in photo.findings],
                }
                for photo in self.detection.photos
            ],
            **({} if self.drawings is None else {"drawings": self.drawings}),
        }


def detect_files(options: DetectOptions, *, run: Run = Run()) -> DetectedFiles:
    """Find the corners of a target in photos and write them, as ``cubicfish detect`` does.

    Raises:
        UsageError: no target is named.
        CubicfishError: a photo or the target cannot be used, no corner could be identified, or a
            file exists and may not be replaced.

    """
    source, file = TargetSource.of(options.target), Path(options.table)
    source.check()
    from cubicfish import detect, save_corners
    from cubicfish_cli.render.drawings import drawings
    from cubicfish_cli.render.overlay import draw_found
    from cubicfish_cli.undistortion.images import write_picture

    plan = Plan(run).reads(options.photos, source)
    plan.writes(file)
    found = named_photos(paths_of(options.photos), run.listener, paths_of(options.exclude))
    folder = path_or_none(options.draw)
    pictures = {} if folder is None else drawings(folder, found)
    plan.writes(*pictures.values(), within=folder)
    detection = detect(found, source.load(run.listener, unplaced=True), run)
    save_corners(file, detection.corners, overwrite=run.overwrite)
    if options.draw is None:
        return DetectedFiles(detection=detection, file=file)
    written, progress = [], run.listener.counting("Drawing")
    for done, (photo, report) in enumerate(zip(found, detection.photos, strict=True)):
        progress(done, len(found))
        if report.found is not None:
            shown = replace(photo, size=detection.corners.image_size).read_grey()
            drawn = draw_found(shown, report, detection.corners)
            write_picture(pictures[photo.name], drawn, overwrite=run.overwrite)
            written.append(pictures[photo.name])
    return DetectedFiles(detection=detection, file=file, drawings=written)


@as_command(
    "detect",
    "Find and name the corners of the target in photos.",
    "cubicfish detect photos/ --target target.yaml",
    "cubicfish detect 'run7/*.png' --target target.yaml -o run7.csv --draw seen/",
    do=detect_files,
    how=("overwrite", "as_json", "jobs", "scheduler", "no_cache"),
)
def command(made: DetectedFiles, given: DetectOptions, how: How) -> None:
    """Find the corners of the target in PHOTOS (files, folders or globs) and name them.

    The result is a table with one corner on each line: image, board, column, row, x, y.
    """
    detection, printed = made.detection, how.print(made)
    report_found([one for photo in detection.photos for one in photo.findings])
    for finding in detection.findings:
        print_message(f"{figures.mark_of(finding)}: {render(finding).line}")
    if not printed:
        corners = detection.corners
        found = f"{plural(len(corners.pixel), 'corner')} in {plural(len(corners.images), 'photo')}"
        figures.print_photo_table(_list_rows(detection), corners.boards)
        result(f"\nwrote {given.table}: {found}")


def _list_rows(detection: Detection) -> list[figures.PhotoRow]:
    by_board, enough = figures.corners_by_board(detection.corners), detection.enough_corners
    rows = []
    for photo in detection.photos:
        remarks = []
        if photo.lost:
            remarks.append(figures.lost_word(photo))
        elif photo.corners < enough:
            remarks.append("few corners")
        if not photo.exact:
            remarks.append("not sure which corners")
        if not photo.lost and photo.remarks:
            remarks.append(f"{plural(len(photo.remarks), 'remark')}")
        rows.append(
            figures.PhotoRow(
                name=photo.name,
                words="; ".join(remarks) or figures.GOOD,
                level="good" if not remarks else "bad" if photo.lost else "care",
                boards=by_board.get(photo.name, {}),
                corners=None if photo.lost else photo.corners,
            )
        )
    return rows
