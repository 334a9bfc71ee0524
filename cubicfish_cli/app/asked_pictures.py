"""What pictures and maps are asked to be: one record for each of the two functions that make them.

Nothing is loaded for it, so that a command line can make it before it is known to be right.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cubicfish_cli.app.asked import StrPath, target_in
from cubicfish_cli.core.errors import UsageError
from cubicfish_cli.core.views.options import INTERPOLATIONS, ViewOptions
from cubicfish_cli.core.wording import did_you_mean, quoted

if TYPE_CHECKING:
    from cubicfish_cli.core.target import Target
    from cubicfish_cli.core.views.view import View

Interpolation = Literal["nearest", "linear", "cubic", "lanczos"]

_WITH_QUALITY = {".jpg", ".jpeg", ".webp"}
_CAMERA_FILES = {".yaml", ".yml"}


@dataclass(frozen=True, kw_only=True)
class PlaneOptions:
    """The plane of a board in each photo, squarely from its front, a square around its corners.

    Attributes:
        board: the name of one of the target's boards.
        target: the target, or its file.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.

    """

    board: str
    target: Target | StrPath
    pixels_per_unit: float | None = None

    def loaded(self) -> Target:
        """The target.

        Raises:
            TargetError: its file cannot be used.

        """
        return target_in(self.target)


@dataclass(frozen=True, kw_only=True)
class PictureOptions:
    """What becomes of photos.

    Attributes:
        view: what to render, or what is asked of it; by default flat, as large as each photo and
            with its scale in the middle, up to 120° across.
        interpolation: how pixels are blended.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photo.
        mask: also writes where the results may be trusted: 255, and 0 elsewhere.
        virtual_camera: also writes the camera of the results: for flat.png, flat.view.yaml and
            flat.view.opencv.yaml.
        skip_existing: leaves out what has its result already.

    Raises:
        UsageError: one is not usable.

    """

    view: View | ViewOptions | PlaneOptions | None = None
    interpolation: Interpolation = "linear"
    quality: int | None = None
    mask: StrPath | None = None
    virtual_camera: StrPath | None = None
    skip_existing: bool = False

    def __post_init__(self) -> None:
        if self.interpolation not in INTERPOLATIONS:
            raise UsageError(
                f"interpolation {quoted(self.interpolation)} is not known: "
                f"{did_you_mean(str(self.interpolation), INTERPOLATIONS)}"
            )
        refuse_beyond("--quality", self.quality, 1, 100)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the pictures that a photo becomes; one without a name unless it is a cube."""
        return self.view.parts if isinstance(self.view, ViewOptions) else ("",)

    def refuse_unused(self, kind: str, suffixes: Collection[str]) -> None:
        """Refuse what says nothing about such sources and results.

        Args:
            kind: what the sources are: photo, video, or what else.
            suffixes: how the names of the results end.

        Raises:
            UsageError: something is asked that would not be done.

        """
        if isinstance(self.view, PlaneOptions) and kind != "photo":
            raise UsageError(
                "--view plane is for the photos of one camera, each of which has its own pose: "
                f"choose another for {kind}s"
            )
        if len(self.parts) > 1 and kind != "photo":
            raise UsageError(f"--view cube is for photos of one camera: choose another for {kind}s")
        if self.virtual_camera is not None:
            beside = Path(self.virtual_camera)
            if beside.is_dir() or (beside.is_file() and beside.suffix.lower() in _CAMERA_FILES):
                raise UsageError(
                    f"--camera says where the camera of the result is written, and {beside} is "
                    "there already: --model names the camera to use"
                )
        if self.quality is not None and not _WITH_QUALITY & {end.lower() for end in suffixes}:
            instead = "use --crf" if kind == "video" else "leave it out"
            raise UsageError(
                f"--quality goes with JPEG and WebP files, not with "
                f"{' and '.join(sorted(suffixes))}: {instead}"
            )


@dataclass(frozen=True, kw_only=True)
class UndistortOptions(PictureOptions):
    """What becomes of photos or of videos: beside what a :class:`PictureOptions` has

    Attributes:
        crf: of videos: lower is better and larger; by default 18.

    Raises:
        UsageError: one is not usable.

    """

    crf: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        refuse_beyond("--crf", self.crf, 0, 63)

    def refuse_unused(self, kind: str, suffixes: Collection[str]) -> None:
        """Refuse what says nothing about such sources and results; see the class above."""
        if self.crf is not None and kind != "video":
            raise UsageError("--crf goes with videos: leave it out, or give JPEG files --quality")
        super().refuse_unused(kind, suffixes)


def refuse_beyond(name: str, value: int | None, low: int, high: int) -> None:
    """Refuse a number that is given and is not whole and within bounds."""
    if value is not None and value not in range(low, high + 1):
        raise UsageError(f"{name} must be a whole number from {low} to {high}, not {quoted(value)}")


@dataclass(frozen=True, kw_only=True)
class MapOptions:
    """What a map of a camera shows.

    Attributes:
        view: what it shows, or what is asked of it; by default flat, as for photos.
        photo_size: (width, height) of photos, an exact rescale of the calibrated ones.
        redistort: makes the way back, from the view to the photo.

    """

    view: View | ViewOptions | None = None
    photo_size: tuple[int, int] | None = None
    redistort: bool = False
