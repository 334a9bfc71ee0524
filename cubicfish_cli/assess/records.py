"""Reading plain records that may hold anything: finite numbers, and mappings in lists."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def recorded_number(value: object) -> float | None:
    """A finite number of a record; None where there is something else, or nothing."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def recorded_mappings(value: object) -> list[Mapping[str, Any]]:
    """The mappings of a list; none of anything else."""
    return [item for item in value if isinstance(item, Mapping)] if isinstance(value, list) else []


class Numbers:
    """The finite numbers of what may be a record, by their names; NaN for what is not known."""

    def __init__(self, record: object) -> None:
        """Look into a mapping; anything else holds none."""
        self._record = record if isinstance(record, Mapping) else {}

    def __getattr__(self, name: str) -> float:
        number = recorded_number(self._record.get(name))
        return math.nan if number is None else number
