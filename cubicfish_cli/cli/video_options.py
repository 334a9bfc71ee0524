"""Options that say how a video is encoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import bundle
from cubicfish_cli.picture_headers import VIDEO_SUFFIXES

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.video import Encoding


def is_video_name(path: Path) -> bool:
    """Whether a file's name is that of a video."""
    return path.suffix.lower() in VIDEO_SUFFIXES


@dataclass(frozen=True, kw_only=True)
class EncodingOptions:
    """What the user asked of a video."""

    codec: str | None
    crf: int | None
    preset: str | None

    def encoding(self) -> Encoding:
        """For the library."""
        from cubicfish_cli.undistortion.video import DEFAULT_CRF, Encoding

        crf = DEFAULT_CRF if self.crf is None else self.crf
        return Encoding(codec=self.codec, crf=crf, preset=self.preset)


encoding_options = bundle(
    "encoding",
    EncodingOptions,
    click.option(
        "--codec",
        metavar="NAME",
        help="Of videos, as FFmpeg calls it: libx265, libvpx-vp9, ffv1. [default: libx264]",
    ),
    click.option(
        "--crf",
        type=IntRange(0, 63),
        metavar="0-63",
        help="Of videos: lower is better and larger. [default: 18]",
    ),
    click.option("--preset", metavar="NAME", help="Of the video encoder, such as fast or slow."),
)
