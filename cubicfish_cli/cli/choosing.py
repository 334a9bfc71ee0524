"""Films among what the user named, and what is told of them: `frames`, `calibrate` and `rig`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli.cache_folder import cache_folder
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.rendering_options import is_video_name
from cubicfish_cli.cli.target_choice import TargetChoice
from cubicfish_cli.cli.terminal import progress, say

if TYPE_CHECKING:
    from cubicfish_cli.films.scan import Measured
    from cubicfish_cli.library.frames import ChosenFrames, Progress
    from cubicfish_cli.photos import Photo


def films_among(inputs: Sequence[Path]) -> list[Path]:
    """Those of the inputs that are films, recordings or patterns of such, by their names."""
    from cubicfish_cli.films.recordings import is_recording

    return [
        path for path in inputs if (is_video_name(path) and not path.is_dir()) or is_recording(path)
    ]


def choose_frames(
    paths: Sequence[Path],
    folder: Path,
    target: TargetChoice | None,
    *,
    most: int,
    jobs: int | None,
    no_cache: bool,
    overwrite: bool,
) -> ChosenFrames:
    """:func:`cubicfish_cli.library.frames.choose_frames`, with what is told on the way."""
    from cubicfish_cli.library.frames import choose_frames as choose

    with _steps() as step:
        return choose(
            paths,
            folder,
            None if target is None else target.load(),
            most=most,
            jobs=jobs,
            cache=None if no_cache else cache_folder(),
            overwrite=overwrite,
            progress=step,
            tell=say_of_film,
        )


def frames_to_calibrate(
    paths: Sequence[Path],
    folder: Path,
    target: TargetChoice,
    *,
    most: int,
    jobs: int | None,
    no_cache: bool,
    overwrite: bool,
) -> tuple[Path, ...]:
    """The frames to calibrate from; those that an earlier run chose of the same films are kept."""
    from cubicfish_cli.library.frames import earlier_frames

    kept = () if no_cache else earlier_frames(paths, folder, target.load(), most=most)
    if kept:
        say(f"{count(len(kept), 'frame')} chosen before in {folder}: these are used.")
        return kept
    chosen = choose_frames(
        paths, folder, target, most=most, jobs=jobs, no_cache=no_cache, overwrite=overwrite
    )
    say(f"{count(len(chosen.photos), 'frame')} of {chosen.frames:,} chosen: {folder}.")
    return chosen.photos


def best_photos(
    photos: Sequence[Photo], target: TargetChoice, most: int, jobs: int | None, *, no_cache: bool
) -> list[Photo]:
    """Those of many photos that are worth calibrating from, in the order given."""
    from cubicfish_cli.library.frames import choose_photos

    cache = None if no_cache else cache_folder()
    with _steps() as step:
        best = choose_photos(
            photos, target.load(), most=most, jobs=jobs, cache=cache, progress=step
        )
    say(f"{count(len(best), 'photo')} of {len(photos):,} chosen, which add most.")
    return best


def say_of_film(measured: Measured) -> None:
    """Say what is odd about a film."""
    from cubicfish_cli.photos import shown

    name = shown(measured.film.path)
    if measured.problem is not None:
        say(f"warning: {measured.problem}")
    if measured.turned_deg:
        say(
            f"note: {name} tells players to turn it by {measured.turned_deg}°: frames are as the "
            "sensor made them"
        )
    if measured.interlaced:
        say(
            f"warning: {name} is interlaced: a frame is two half pictures of different times, and "
            "only good where nothing moves"
        )


@contextmanager
def _steps() -> Iterator[Progress]:
    """A line of progress for each step of a long piece of work."""
    with ExitStack() as stack:
        line, now = None, ""

        def step(what: str, done: int, total: int) -> None:
            nonlocal line, now
            if line is None or what != now:
                stack.close()
                line, now = stack.enter_context(progress(what)), what
            line(done, total)

        yield step
