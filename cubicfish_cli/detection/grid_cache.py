"""Grids of photos that were searched before, so that unchanged photos are not searched again.

An entry is named by the SHA-256 of the photo's bytes and by what searches: the version of the
package and of its finder's source. What the photo shows does not depend on its name or place.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
import zlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from cubicfish_cli import __version__, detection
from cubicfish_cli.detection.grids import FoundGrids, Grid
from cubicfish_cli.errors import OutputError
from cubicfish_cli.files import whole_file

# No photo holds more grids than this; a larger count is a damaged entry.
_MAX_GRIDS = 10_000
# What numpy and zipfile raise on an entry that is missing, cut short or overwritten.
_DAMAGE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    zipfile.BadZipFile,
    zlib.error,
)


@dataclass(frozen=True, kw_only=True)
class GridCache:
    """A folder with one file a photo.

    Attributes:
        folder: where the entries are; made when the first is written.

    """

    folder: Path

    def key(self, data: bytes) -> str:
        """Name of the entry of a photo with these bytes."""
        return hashlib.sha256(data).hexdigest()[:32] + "-" + _searcher()

    def load(self, key: str) -> FoundGrids | None:
        """The entry, or None where there is none or it is damaged."""
        try:
            path = self.folder / f"{key}.npz"
            if not path.is_file():  # a pipe would be waited for
                return None
            # Through memory: numpy leaves a damaged file open.
            data = io.BytesIO(path.read_bytes())
            with np.load(data, allow_pickle=False) as entry:
                if str(entry["key"]) != key:  # another photo's, under a name that is not its own
                    return None
                count = int(entry["count"])
                if not 0 <= count <= _MAX_GRIDS:
                    return None
                width, height = (int(side) for side in entry["image_size"])
                return FoundGrids(
                    grids=tuple(
                        Grid(
                            cells=entry[f"cells_{index}"],
                            pixel=entry[f"pixel_{index}"],
                            parity=int(entry["parity"][index]),
                            step=float(entry["step"][index]),
                            contrast=entry[f"contrast_{index}"],
                        )
                        for index in range(count)
                    ),
                    refused=entry["refused"],
                    image_size=(width, height),
                )
        except _DAMAGE:
            return None

    def save(self, key: str, found: FoundGrids) -> None:
        """Write an entry; a cache that cannot be written is no cache, and no error."""
        grids = found.grids
        parts = {
            f"{name}_{index}": getattr(grid, name)
            for index, grid in enumerate(grids)
            for name in ("cells", "pixel", "contrast")
        }
        try:
            with whole_file(self.folder / f"{key}.npz", overwrite=True) as temporary:
                np.savez_compressed(
                    temporary,
                    key=key,
                    count=len(grids),
                    parity=np.array([grid.parity for grid in grids], int),
                    step=np.array([grid.step for grid in grids], float),
                    refused=found.refused,
                    image_size=np.array(found.image_size),
                    allow_pickle=False,
                    **parts,
                )
        except OutputError:
            return


@cache
def _searcher() -> str:
    """The package's version and a hash of the source that finds grids."""
    digest = hashlib.sha256(__version__.encode())
    for path in sorted(Path(str(detection.__file__)).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
