"""Options that say how a video is encoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli.numbers import IntRange
from cubicfish_cli.cli.options import bundle, option
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
    option(
        "--codec NAME",
        "Of videos, as FFmpeg calls it: libx265, libvpx-vp9, ffv1. [default: libx264]",
    ),
    option("--crf 0-63", "Of videos: lower is better and larger. [default: 18]", IntRange(0, 63)),
    option("--preset NAME", "Of the video encoder, such as fast or slow."),
)
