"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Collection, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from cubicfish import OutputError, PhotoError, Run, UsageError
from cubicfish.files import StrPath
from cubicfish.views import Interpolation, ViewOptions
from cubicfish_cli.commands.view_options import (
    report_unseen,
    view_options,
    view_or_plane_options,
)
from cubicfish_cli.inputs.paths import in_folder, named_photos, paths_of
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_always, print_message, print_wrote, result
from cubicfish_cli.undistortion.options import PlaneOptions
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Calibration, CameraFile, CubicCamera, View
    from cubicfish_cli.commands.pictures import UndistortedFiles
    from cubicfish_cli.undistortion.batch import Views

_NEVER_WRITTEN = (".heic", ".heif", ".hif")
_WITH_QUALITY = {".jpg", ".jpeg", ".webp"}
_FEW = 10


@record
class PictureOptions:
    """Options of rendering photos.

    Attributes:
        view: the view, or options of one; by default flat, as large as each photo and with its
            scale in the middle, up to 120° across.
        interpolation: how pixels are interpolated.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photo.
        mask: also write where the results may be trusted: 255, and 0 elsewhere.
        virtual_camera: also write the camera of the results: for flat.png, flat.view.yaml.
        skip_existing: leave out what has its result already.

    """

    view: View | ViewOptions | PlaneOptions | None = view_options
    interpolation: Interpolation = option(
        "--interpolation",
        "How values between pixels are worked out.",
        parameters.Choice(get_args(Interpolation)),
        "linear",
    )
    quality: int | None = option(
        "--quality 1-100",
        "Quality of JPEG and lossy WebP files. [default: the photo's own]",
        click.IntRange(1, 100),
    )
    mask: StrPath | None = option(
        "--mask FILE",
        "Also write a picture that is 255 where the result may be trusted, and 0 elsewhere.",
        parameters.FILE,
    )
    virtual_camera: StrPath | None = option(
        "--camera FILE",
        "Also write the virtual camera that took the result: for flat.png, flat.view.yaml.",
        parameters.FILE,
    )
    skip_existing: bool = option("--skip-existing", "Leave out photos whose result exists already.")

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the pictures that a photo becomes; one without a name unless it is a cube."""
        return self.view.parts if isinstance(self.view, ViewOptions) else ("",)

    def files_beside(self) -> list[Path]:
        """The masks and the virtual cameras that are asked for."""
        from cubicfish_cli.undistortion.map_formats import camera_path

        files = [] if self.mask is None else [*self.results(Path(self.mask)).values()]
        if self.virtual_camera is not None:
            camera = Path(self.virtual_camera)
            if not camera.name:
                raise UsageError("--camera must be the name of a file")
            files += [camera_path(camera, part) for part in self.parts]
        return files

    def results(self, path: Path) -> dict[str, Path]:
        """The file of each part of the view, by the name of the whole."""
        from cubicfish_cli.undistortion.images import part_name

        return {part: part_name(path, part) for part in self.parts}

    def refuse_unused(self, kind: str, suffixes: Collection[str]) -> None:
        """Refuse options that have no effect on such sources and results.

        Args:
            kind: the kind of source: photo, video, or what an extension adds.
            suffixes: of the results' names.

        Raises:
            UsageError: an option would have no effect.

        """
        if isinstance(self.view, PlaneOptions) and kind != "photo":
            raise UsageError(
                "--view plane is for the photos of one camera, each of which has its own pose: "
                f"choose another for {kind}s"
            )
        if len(self.parts) > 1 and kind != "photo":
            raise UsageError(f"--view cube is for photos of one camera: choose another for {kind}s")
        if self.quality is not None and not _WITH_QUALITY & {end.lower() for end in suffixes}:
            instead = "use --crf" if kind == "video" else "leave it out"
            raise UsageError(
                f"--quality goes with JPEG and WebP files, not with "
                f"{' and '.join(sorted(suffixes))}: {instead}"
            )


@record
class UndistortOptions(PictureOptions):
    """Options of :func:`undistort_files`, beside those of :class:`PictureOptions`.

    Attributes:
        photos: files, folders and globs of photos, or files and globs of videos; of the size that
            the camera was calibrated for, or an exact rescale of it.
        output: a folder; for one photo or video that is named alone, also a name for its result.
        camera: the file or folder of the camera, or a camera or a fit.
        view: for photos also the plane of a board.
        crf: quality of videos: a lower number is better and makes a larger file. By default 18.

    """

    photos: StrPath | Sequence[StrPath] = parameters.argument(
        "Photos or videos: files, folders or globs; '-' reads their names from stdin.",
        type=parameters.NAME,
        nargs=-1,
        required=True,
        metavar="IN...",
    )
    output: StrPath = parameters.argument(
        "The picture or video that is made of one; of several, or without a suffix, a folder.",
        metavar="OUT",
    )
    camera: StrPath | Calibration | CameraFile | CubicCamera = parameters.model_options
    view: View | ViewOptions | PlaneOptions | None = view_or_plane_options
    crf: int | None = option(
        "--crf 0-63",
        "Quality of a video: a lower number is better, and makes a larger file. [default: 18]",
        click.IntRange(0, 63),
    )

    def refuse_unused(self, kind: str, suffixes: Collection[str]) -> None:
        """Refuse also the quality of videos for photos."""
        if kind == "photo" and self.crf is not None:
            raise UsageError("--crf goes with videos: leave it out, or give JPEG files --quality")
        super().refuse_unused(kind, suffixes)


def undistort_files(options: UndistortOptions, *, run: Run = Run()) -> UndistortedFiles:
    """Undistort photos or videos in files, as ``cubicfish undistort`` does.

    Results in a folder keep the names of their photos, and all keep depth, channels and a JPEG's
    EXIF record. A photo that fails does not stop the others.

    Returns:
        The ``files`` that were written, what was ``skipped``, and what ``failed`` and why.

    Raises:
        UsageError: inputs or options do not go together, such as photos and videos.
        PhotoError: there are no photos.
        OutputError: a result exists, and it may be neither replaced nor skipped, or it would
            replace its own photo.
        ViewError: a mask or a camera would be another one for each photo.
        CubicfishError: the camera, the target or the executor cannot be used.

    """
    from cubicfish_cli.commands.pictures import plan_pictures, write_pictures

    kind, sources, alone = _find_sources(named_sources(options.photos), run)
    if kind == "video" and (run.executor is not None or run.jobs is not None):
        name = "--jobs" if run.executor is None else "--scheduler"
        raise UsageError(f"{name} is for photos: do videos without it")
    camera: Any = options.camera
    path = in_folder(Path(camera)) if isinstance(camera, str | os.PathLike) else None
    plane = options.view.target if isinstance(options.view, PlaneOptions) else None
    register = Plan(run, skip_existing=options.skip_existing).reads(path, plane)
    photos = {name: (_result_name(name), {"": one}) for name, one in sources.items()}
    plan = plan_pictures(kind, photos, Path(options.output), options, register, alone=alone)
    views = _make_views(kind, path or camera, [*sources.values()], options, run)
    return write_pictures(plan, views, run, model=path)


def _result_name(name: str) -> str:
    """The name of a photo's result in a folder: the photo's own, if such pictures are written."""
    own = Path(name)
    return str(own.with_suffix(".png")) if own.suffix.lower() in _NEVER_WRITTEN else name


def _find_sources(names: Sequence[str], run: Run) -> tuple[str, dict[str, Path], bool]:
    """Find the photos or videos, by their names; and tell whether one was named alone.

    Raises:
        UsageError: photos and videos are mixed.
        PhotoError: there are none.
        OutputError: two videos have one name.

    """
    from cubicfish.photos import expand_pattern
    from cubicfish_cli.inputs.paths import is_video

    paths = [path for name in names for path in expand_pattern(name)]
    videos = list(filter(is_video, paths))
    if not videos:
        kind, sources = "photo", {one.name: one.path for one in named_photos(names, run.listener)}
    elif len(videos) < len(paths):
        raise UsageError("photos and videos together: do them one after the other")
    else:
        kind, sources = "video", {path.name: path for path in videos}
        if len(sources) < len(videos):
            raise OutputError("two videos have the same name: do them one at a time")
    alone = len(names) == 1 and [*map(os.fspath, sources.values())] == [*names]
    return kind, sources, alone


def _make_views(
    kind: str,
    given: Path | Calibration | CameraFile | CubicCamera,
    sources: Sequence[Path],
    options: UndistortOptions,
    run: Run,
) -> Views:
    """Prepare the views of photos or videos."""
    from cubicfish import CubicCamera
    from cubicfish.io import read_camera
    from cubicfish_cli.undistortion.batch import Views

    how = options.interpolation
    if isinstance(options.view, PlaneOptions):
        from cubicfish_cli.commands.planes import PlaneViews

        planes = PlaneViews(given, options.view, how)
        planes.find_poses(sources, run)
        return planes
    known = read_camera(given) if isinstance(given, Path) else given
    camera = known if isinstance(known, CubicCamera) else known.camera
    if kind == "photo":
        return Views(camera, options.view, how)
    from cubicfish_cli.undistortion.video import DEFAULT_CRF, VideoViews

    crf = DEFAULT_CRF if options.crf is None else options.crf
    return VideoViews(camera, options.view, how, crf, run.listener)


@as_command(
    "undistort",
    "Undistort photos and videos.",
    "cubicfish undistort photo.png flat.png",
    "cubicfish undistort photos/ flat/ --hfov 90 --size 1920x1080",
    "cubicfish undistort photo.png left.png --rotate -60,0,0 --hfov 80",
    "cubicfish undistort photos/ all/ --view equidistant --fit outer --skip-existing",
    "find . -name '*.jpg' | cubicfish undistort - flat/ -j 4",
    "cubicfish undistort photo.jpg floor.png --view plane:floor --target target.yaml",
    "cubicfish undistort drive.mp4 flat.mp4 --hfov 100 --crf 20",
    "cubicfish undistort photos/ flat/ --scheduler tcp://node1:8786",
    do=undistort_files,
    how=("overwrite", "as_json", "jobs", "scheduler"),
)
def command(made: UndistortedFiles, given: UndistortOptions, how: How) -> None:
    """Render the photo IN as the picture OUT, flat unless --view says otherwise; or a video.

    With several photos, a folder or a quoted glob as IN, OUT is a folder, and the pictures keep
    their names. '-' reads the names of the photos from stdin. Pixels that the camera does not see
    are black. A picture keeps the depth and the channels of its photo, and the EXIF record and the
    quality of a JPEG; a video keeps its audio and its timestamps.
    """
    if made.view is not None and not how.as_json:
        report_unseen(made.view)
    print_pictures(made, how)


def print_pictures(made: UndistortedFiles, how: How) -> None:
    """Print the files that were written.

    Raises:
        CubicfishError: some failed; the text says how many, and where the reasons are.

    """
    number, failures = len(made.written) + len(made.failures), made.failures
    if not how.print(made):
        if number > 1:
            _print_failures(made)
        if made.skipped:
            print_message(f"skipped {plural(len(made.skipped), made.kind)} whose result exists")
        if made.view is not None:
            what = plural(len(made.files), "video" if made.kind == "video" else "picture")
            alone = len(made.files) == 1 == number
            there = made.files[0] if alone else f"{what} to {made.files[0].parent}"
            result(f"wrote {there}: {made.view.describe()}")
        elif not failures:
            result("nothing to do")
        if not failures:
            print_wrote(made.extras)
    if number == 1:
        for failure in failures.values():
            raise failure
    if failures:
        raise PhotoError(
            f"{len(failures):,} of {plural(number, made.kind)} could not be undistorted: see "
            f"{'the JSON' if how.as_json else 'above'}"
        )


def _print_failures(made: UndistortedFiles) -> None:
    """Say of the first that failed why they did."""
    from cubicfish_cli.words.sentences import render_error

    for name, error in islice(made.failures.items(), _FEW):
        shot = f"shot {name}: " if made.kind == "shot" else ""
        print_always(f"failed: {shot}{render_error(error)}")
    if len(made.failures) > _FEW:
        print_always(f"and {len(made.failures) - _FEW:,} more, which --json lists")


def named_sources(sources: StrPath | Sequence[StrPath]) -> list[str]:
    """Return the names of the sources, with those that stdin lists in the place of '-'."""
    names: list[str] = []
    for source in map(os.fspath, paths_of(sources)):
        if source != "-":
            names.append(source)
            continue
        text = sys.stdin.read()
        # As 'find -print0' has them, or a line each.
        listed = text.split("\0") if "\0" in text else re.split("\r?\n", text)
        listed = [name for name in listed if name.strip()]
        if not listed:
            raise click.UsageError("stdin lists no photos: give one name a line")
        names += listed
    return names
