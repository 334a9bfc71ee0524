"""The keys that docs/json_keys.toml says of what commands print with ``--json``."""

import tomllib
from collections.abc import Mapping

from running import ROOT

_TABLES = tomllib.loads((ROOT / "docs" / "json_keys.toml").read_text(encoding="utf-8"))


def keys_of(command: str) -> Mapping[str, str]:
    """Key -> meaning, of a command such as ``target-check``."""
    table: Mapping[str, str] = _TABLES[command]
    return table
