"""How wide a field each kind of central view can show.

Nothing is loaded for it, so that a command line can make use of it before it is known to be right.
"""

from __future__ import annotations

from collections.abc import Mapping

WIDEST: Mapping[str, tuple[tuple[float, bool], tuple[float, bool]]] = {
    "perspective": ((180, False), (180, False)),
    "cylindrical": ((360, True), (180, False)),
    "equirectangular": ((360, True), (180, True)),
    "epipolar-cylindrical": ((180, False), (360, True)),
    "epipolar-equirectangular": ((180, True), (360, True)),
    "stereographic": ((360, False), (360, False)),
    "equidistant": ((360, True), (360, True)),
}
"""Kind -> across and down: degrees, and whether a field may be as wide or must stay below."""
