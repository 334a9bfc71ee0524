"""``cubicfish shoot``: photos taken with guidance, until they are enough."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import TYPE_CHECKING, Any

from cubicfish import Run, UsageError, quoted
from cubicfish.files import StrPath
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.plan import Plan
from cubicfish_cli.stages import camera_files
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, as_command, option, record, target_options
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, result
from cubicfish_cli.words.phrases import shell_line

if TYPE_CHECKING:
    from cubicfish import Target

HERE = "127.0.0.1"


@record
class ShootOptions:
    """Options of :func:`shoot_files`.

    Attributes:
        photos: the folder of the photos.
        target: the calibration target, or its file.
        camera: a camera's number, a URL or a film that takes the photos.
        folder: where "Finish" writes the calibration.
        goal_px: the uncertainty wanted over 95 % of the field; None for what is usual.
        listen: the address of this machine that the page is served on.
        page: whether there is a page; without one guidance is lines of text.
        on_screen: whether the page shows the board itself.

    """

    photos: StrPath = parameters.argument(
        "The folder that photos appear in, or that --camera puts them into.",
        metavar="FOLDER",
    )
    target: TargetSource | StrPath | None = target_options
    camera: str | None = option(
        "--camera 0|URL|FILM",
        "Take the photos with a camera of this machine, by its number, from a stream, or from a "
        "film: frames that are sharp, still and show something new go into the folder.",
    )
    folder: StrPath = parameters.output_option(
        "Where Finish writes the calibration.", default="calibration", folder=True
    )
    goal_px: float | None = option(
        "--goal PX",
        "The uncertainty wanted over 95 % of the field. [default: 0.2 px, more for photos above "
        "2000 px]",
        FloatRange(min=0, min_open=True),
    )
    listen: str = option(
        "--listen ADDRESS",
        "Serve the page to a network, as for a phone's screen: everybody in it who has the page's "
        "address sees the pictures, and nothing is encrypted.",
        default=HERE,
    )
    page: bool = option(
        "--page/--no-page", "Guide on a page in the browser, or here, in lines.", default=True
    )
    on_screen: bool = option(
        "--on-screen", "Show the board on the page too, in true size by a ruler, to photograph it."
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """Result of :func:`shoot_files`.

    Attributes:
        photos: the photos in the folder that are not left out, or the folder itself.

    """

    photos: tuple[Path, ...]


def shoot_files(options: ShootOptions, *, run: Run = Run()) -> Shot:
    """Guide somebody who takes photos, as ``cubicfish shoot`` does, until that is ended.

    Raises:
        UsageError: the options do not go together.
        CubicfishError: the target or the camera cannot be used, or the calibration's files exist
            and may not be replaced.

    """
    from cubicfish_cli.extensions.shoot import words
    from cubicfish_cli.extensions.shoot.camera import Camera
    from cubicfish_cli.extensions.shoot.server import Page
    from cubicfish_cli.extensions.shoot.shoot import Shoot

    if not options.page and (options.on_screen or options.listen != HERE):
        raise UsageError("--on-screen and --listen are of the page: leave --no-page out")
    source, folder = TargetSource.of(options.target), Path(options.folder)
    photos = Path(options.photos)
    targets = source.load(run.listener)
    # What else there will be is known when it is finished.
    Plan(run).reads(options.photos, source).writes(camera_files(folder)["camera"])
    if photos.exists() and not photos.is_dir():
        raise UsageError(f"{quoted(str(photos))} is a file: name a folder for the photos")
    camera = None if options.camera is None else Camera(options.camera)
    page = Page(options.listen, camera) if options.page else None
    asked: Queue[dict[str, Any]] = Queue() if page is None else page.asked
    lines = words.about_target(targets[0])
    if page is None:
        result("\n".join([*lines, words.TO_FINISH]))
        Thread(target=_wait_for_enter, args=(asked,), daemon=True).start()
    else:
        result(words.opened(page.address))
    if options.listen != HERE:
        print_message(words.LISTENING)
    if camera is not None:
        camera.start()
    shoot = Shoot(
        folder=photos,
        targets=targets,
        run=run,
        goal_px=options.goal_px,
        camera=camera,
        page=page,
        asked=asked,
        say=result,
        calibrate=_Finish(source=source, folder=folder, run=run),
        first={"lines": lines, "screen": _draw(targets[0]) if options.on_screen else None},
    )
    shoot.go_on()
    return Shot(photos=tuple(shoot.used()))


def _draw(target: Target) -> dict[str, Any]:
    """The first board as a screen shows it, in millimetres: an SVG path, and its paper's box."""
    from cubicfish.scene import board_face
    from cubicfish.target import MILLIMETRES

    board, mm = target.boards[0], MILLIMETRES[target.units]
    face = board_face(board, margin=1)
    row, column = face.dark.nonzero()
    places = [face.x[column], face.y[row], face.x[column + 1], face.y[row + 1]]
    cells = zip(*(mm * place for place in places), strict=True)
    dark = "".join(f"M{a:g} {b:g}H{c:g}V{d:g}H{a:g}z" for a, b, c, d in cells)
    (left, top), (right, bottom) = face.lower, face.upper
    box = [mm * side for side in (left, top, right - left, bottom - top)]
    return {"dark": dark, "box": box, "square": mm * board.square}


@dataclass(kw_only=True)
class _Finish:
    """Calibrates from the photos, as ``cubicfish calibrate`` does.

    Attributes:
        source: what they show.
        folder: where the calibration goes.
        run: how the work is done; files that an earlier call wrote are replaced.

    """

    source: TargetSource
    folder: Path
    run: Run

    def __call__(self, photos: Sequence[Path]) -> tuple[str, Path]:
        from cubicfish_cli.commands.calibrate import CalibrateOptions, calibrate_files
        from cubicfish_cli.extensions.shoot import words
        from cubicfish_cli.render.pages import PAGE

        line = ["cubicfish", "calibrate", *map(str, photos)]
        if self.source.counts is not None:
            line += ["--board", "{}x{}".format(*self.source.counts)]
            line += ["--square", f"{self.source.square:g}mm"]
        elif self.source.path is not None and not self.source.by_default:
            line += ["--target", str(self.source.path)]
        options = CalibrateOptions(inputs=photos, target=self.source, folder=self.folder)
        made = calibrate_files(options, run=replace(self.run, command=shell_line(*line)))
        self.run = replace(self.run, overwrite=True)
        said = words.finished(made.fitted.verdict, self.folder)
        return said, made.files.get("report", self.folder / PAGE)


def _wait_for_enter(asked: Queue[dict[str, Any]]) -> None:
    if sys.stdin.readline():
        asked.put({"do": "finish"})


@as_command(
    "shoot",
    "Take the photos with guidance: what is wrong with each, and the next pose.",
    "cubicfish shoot photos/ --board 9x6 --square 25mm",
    "cubicfish shoot photos/ --target target.yaml --camera 0",
    "cubicfish shoot photos/ --target target.yaml --no-page",
    do=shoot_files,
    how=("overwrite", "jobs", "no_cache"),
)
def command(made: Shot, given: ShootOptions, how: How) -> None:
    """Guide through a shoot: photos that appear in FOLDER, or that --camera takes.

    A page in the browser, of this machine alone, shows the last photo with its corners, what is
    wrong with it, what corners cover, how uncertain the camera is, and as a ghost board where the
    target should be next. Finish calibrates from these photos as 'cubicfish calibrate' does.
    Ctrl-C, a closed page or a killed process lose no photo; started again it goes on.
    """
