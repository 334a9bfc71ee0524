"""What the objects that ``--json`` prints hold, as ``json_keys.toml`` has it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from string import Template

_FILE = Path(__file__).with_suffix(".toml")


@cache
def _tables() -> Mapping[str, Mapping[str, str]]:
    return tomllib.loads(_FILE.read_text(encoding="utf-8"))


def keys_of(command: str) -> Mapping[str, str]:
    """Key -> meaning of what a command prints."""
    data = _tables()
    return {key: Template(text).substitute(data["parts"]) for key, text in data[command].items()}
