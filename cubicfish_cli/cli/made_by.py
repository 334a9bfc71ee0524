"""What a file says about how it was made."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cubicfish_cli import __version__
from cubicfish_cli.errors import CubicfishError


def made_at() -> str:
    """The time in UTC, or that of SOURCE_DATE_EPOCH, with which results can be made again.

    Raises:
        CubicfishError: SOURCE_DATE_EPOCH is set to something else than seconds.

    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        moment = datetime.now(UTC) if epoch is None else datetime.fromtimestamp(int(epoch), UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise CubicfishError(
            f"SOURCE_DATE_EPOCH={epoch!r} is not a time in seconds since 1970: correct or unset it"
        ) from error
    return moment.isoformat(timespec="seconds")


def made_by_record(
    options: Mapping[str, Any], target: Path | None, files: Sequence[Path]
) -> dict[str, Any]:
    """Version, date and options, and the SHA-256 of the target and of every input."""
    from cubicfish_cli.files import sha256_of

    return {
        "version": __version__,
        "date": made_at(),
        "options": dict(options),
        "target": {"file": str(target), "sha256": sha256_of(target)} if target else None,
        "inputs": [{"file": str(path), "sha256": sha256_of(path)} for path in files],
    }
