"""Cache directory."""

from __future__ import annotations

import atexit
import os
import sys
import tempfile
from pathlib import Path


def cache_folder() -> Path | None:
    """Where it is kept: CUBICFISH_CACHE, else the user's cache folder; None without a home."""
    named = os.environ.get("CUBICFISH_CACHE")
    if named:
        return Path(named).absolute()
    from platformdirs import user_cache_path

    # Nobody that this machine knows, as in some containers, has no home.
    try:
        folder = user_cache_path("cubicfish", appauthor=False)
    except RuntimeError:  # newer versions; older ones leave the ~
        return None
    return None if folder.parts[0] == "~" else folder.absolute()


def keep_fonts(keep: bool = True) -> None:
    """Tell matplotlib, before it is loaded, where its list of this machine's fonts belongs.

    By itself it makes two folders of its own in the user's home. The list takes up to seconds to
    make, so it is kept with the rest.

    Args:
        keep: false where nothing may be kept: then the folder ends with this process.

    """
    if "MPLCONFIGDIR" in os.environ or "matplotlib" in sys.modules:
        return
    folder = cache_folder() if keep else None
    if folder is not None:
        # One that cannot be made or written to: matplotlib takes a temporary one instead.
        os.environ["MPLCONFIGDIR"] = str(folder / "matplotlib")
        return
    temporary = tempfile.TemporaryDirectory(prefix="cubicfish-", ignore_cleanup_errors=True)
    atexit.register(temporary.cleanup)
    os.environ["MPLCONFIGDIR"] = temporary.name
