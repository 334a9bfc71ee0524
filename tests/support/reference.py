"""The script docs/cli.py, and what it reads of commands."""

from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

from command_tree import commands
from samples import ROOT


def load_script() -> ModuleType:
    """The script that makes docs/cli.md, anew."""
    spec = spec_from_file_location("docs_cli", ROOT / "docs" / "cli.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def keys_of(command: str) -> dict[str, str]:
    """Key -> meaning of what a command, such as ``target check``, prints with ``--json``."""
    (found,) = (one for words, one in commands() if " ".join(words[1:]) == command)
    keys: dict[str, str] = load_script().json_keys(found)
    return keys
