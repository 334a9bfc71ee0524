"""``cubicfish frames``: from films to the few frames that are worth calibrating from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import Event, PhotoError, Run
from cubicfish.files import StrPath
from cubicfish_cli.films import MOST
from cubicfish_cli.inputs.paths import paths_of
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import as_command, option, record, target_options
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_next, result
from cubicfish_cli.words.phrases import plural, shell_line

if TYPE_CHECKING:
    from cubicfish import Target
    from cubicfish.photos import Photo


@record
class FramesOptions:
    """Options of :func:`choose_frames`.

    Attributes:
        films: films of one camera: files, recordings with their topic, or globs.
        target: the calibration target or its file; None looks for any checkerboard.
        folder: the folder for the frames.
        most: how many frames may be chosen.

    """

    films: StrPath | Sequence[StrPath] = parameters.argument(
        "Films of one camera, all of one size.", nargs=-1, required=True, metavar="FILM..."
    )
    target: TargetSource | Target | StrPath | None = target_options
    folder: StrPath = parameters.output_option(
        "Where the frames (PNG, with their time in the name) and contact_sheet.html go.",
        folder=True,
        required=True,
    )
    most: int = option("--most N", "Choose at most N frames.", click.IntRange(min=1), MOST)


@dataclass(frozen=True, kw_only=True)
class ChosenFrames:
    """Result of :func:`choose_frames`.

    Attributes:
        photos: the pictures that were written, in the films' order.
        sheet: the contact sheet.
        frames: how many frames the films have.
        looked_at: how many of them were searched for corners.
        ended: why no more were chosen, in a sentence.
        films: a record per film: its path, frames, image_size, seconds, turned_deg (the turn that
            it asks of players), missing (how many announced frames it lacks or could not be
            decoded), and the problem with it in one line or None.

    """

    photos: tuple[Path, ...]
    sheet: Path
    frames: int
    looked_at: int
    ended: str
    films: tuple[dict[str, Any], ...]

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish frames --json`` prints.

        Keys:
            photos: the pictures of the frames chosen
            sheet: the page that shows those chosen
            frames: how many frames the films have
            looked_at: in how many of them corners were looked for
            ended: why no more were chosen, in a sentence
            films: a record a film: film, frames, image_size, seconds, turned_deg (what players
                are told), missing (how many frames could not be decoded), problem

        """
        return dict(vars(self))


def choose_frames(options: FramesOptions, *, run: Run = Run()) -> ChosenFrames:
    """Choose the frames of films that a camera is best calibrated from, as ``cubicfish frames``.

    They are written as PNG, with their time in the name, beside a contact sheet: all files or none.

    Raises:
        PhotoError: a film cannot be used.
        DetectionError: no frame shows the target.
        OutputError: ``folder`` holds frames already, or cannot be written; the extra ``video`` is
            not installed.

    """
    return _choose_frames(options, run)[0]


def _choose_frames(options: FramesOptions, run: Run) -> tuple[ChosenFrames, list[Photo]]:
    """Choose and write frames: what is told of them, and the frames themselves."""
    from cubicfish_cli.extensions.films.frames import chosen_of, scanned
    from cubicfish_cli.extensions.films.written import SHEET, write_chosen
    from cubicfish_cli.films.scan import room_for_frames
    from cubicfish_cli.films.source import open_films

    folder, source = Path(options.folder), TargetSource.of(options.target)
    plan = Plan(run).reads(options.films, source)
    plan.writes(folder / SHEET)
    targets = source.load(run.listener) if source.is_known else None
    films = open_films(_expand(options.films))
    with room_for_frames(folder) as room:
        measured = scanned(films, room, options.most, run.listener)
        chosen = chosen_of(measured, targets, options.most, run)
        plan.writes(*(folder / frame.photo.name for frame in chosen.taken), within=folder)
        run.listener.progress("Writing frames")
        write_chosen(folder, chosen, plan)
    photos = [
        replace(frame.photo, path=folder / frame.photo.name, has_file=True)
        for frame in chosen.taken
    ]
    told = ChosenFrames(
        photos=tuple(photo.path for photo in photos),
        sheet=folder / SHEET,
        frames=sum(map(len, measured)),
        looked_at=chosen.looked_at,
        ended=chosen.ended,
        films=tuple(
            {
                "film": str(one.film.path),
                "frames": len(one),
                "image_size": one.film.size,
                "seconds": one.time[-1],
                "turned_deg": one.turned_deg,
                "missing": one.missing,
                "problem": one.problem,
            }
            for one in measured
        ),
    )
    return told, photos


def _expand(films: StrPath | Sequence[StrPath]) -> list[Path]:
    """Return films, with patterns replaced by what they match."""
    from cubicfish.photos import expand_pattern

    matches = {path: expand_pattern(path) for path in paths_of(films)}
    for path in matches:
        if not matches[path]:
            raise PhotoError(f"{path} matches no film: check the name and the current folder")
    if not matches:
        raise PhotoError("no film was given: name one, or a pattern that matches some")
    return [match for every in matches.values() for match in every]


def frames_of(
    films: Sequence[Path], folder: Path, target: TargetSource, best: int | None, run: Run
) -> tuple[Sequence[Photo], str]:
    """Choose frames of films that a camera is calibrated from.

    Args:
        films: the films.
        folder: the folder for the frames.
        target: the calibration target.
        best: how many frames to choose at most; None for the usual number.
        run: how the work is done.

    Returns:
        The frames, and why no more were chosen, in a sentence.

    Raises:
        CubicfishError: a film cannot be used.

    """
    target = replace(target, by_default=False)  # the listener hears it where corners are found
    options = FramesOptions(films=films, folder=folder, target=target, most=best or MOST)
    chosen, photos = _choose_frames(options, run)
    figures = {"chosen": len(chosen.photos), "frames": chosen.frames, "folder": folder}
    run.listener.tell(Event.FRAMES_CHOSEN, **figures, ended=chosen.ended)
    return photos, chosen.ended


@as_command(
    "frames",
    "Choose frames of films to calibrate from.",
    "cubicfish frames film.mp4 -o photos/ --target target.yaml",
    "cubicfish frames 'films/*.mp4' -o photos/ --most 40",
    do=choose_frames,
    how=("overwrite", "as_json", "jobs", "no_cache"),
)
def command(chosen: ChosenFrames, given: FramesOptions, how: How) -> None:
    """Choose the frames of each FILM that are best to calibrate its camera from.

    The chosen frames are sharp and still, and each shows something that the others do not: corners
    in another part of the picture, or a board from another side.
    """
    from cubicfish import shown

    if not how.print(chosen):
        _print(chosen, given)
    for film in chosen.films:
        if film["problem"]:
            raise PhotoError(film["problem"])
        if film["missing"]:
            raise PhotoError(
                f"{film['missing']:,} of the {film['frames'] + film['missing']:,} frames of "
                f"{shown(Path(film['film']))} are missing, and what is written was chosen of the "
                "rest: copy the film again if you can"
            )


def _print(chosen: ChosenFrames, given: FramesOptions) -> None:
    target = given.target
    result(
        f"{plural(len(chosen.photos), 'frame')} of {chosen.frames:,} chosen; boards were looked "
        f"for in {chosen.looked_at}"
    )
    result(chosen.ended)
    result(f"wrote {given.folder}: frames and {chosen.sheet.name}")
    if isinstance(target, TargetSource) and target.path is not None:
        folder = Path(given.folder)
        print_next(shell_line("cubicfish", "calibrate", folder, "--target", target.path))
