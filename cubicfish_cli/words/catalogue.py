"""The sentences of ``catalogue.toml``, and those of extensions, read once."""

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

from cubicfish.judge.finding import FindingText
from cubicfish_cli.extension_guard import extensions

_FILE = Path(__file__).with_name("catalogue.toml")
_TEXTS = ("what", "evidence", "do")


class Catalogue(NamedTuple):
    """All templates.

    Attributes:
        finding_texts: by code and case.
        because: evidence by its key.
        phrases: parts of sentences, by the name of a figure and its value.
        events: sentences for events while work is done, by event.
        checks: sentences about a target before any photo.
        options: what the command line calls the arguments that errors name.

    """

    finding_texts: Mapping[tuple[str, str], FindingText]
    because: Mapping[str, str]
    phrases: Mapping[str, Mapping[str, str]]
    events: Mapping[str, str]
    checks: Mapping[str, str]
    options: Mapping[str, str]


@cache
def catalogue() -> Catalogue:
    """Return the templates, with the parts that they share filled in."""
    data = tomllib.loads(_FILE.read_text(encoding="utf-8"))
    for one in extensions().values():
        if one.words is not None:
            for table, own in tomllib.loads(one.words.read_text(encoding="utf-8")).items():
                data[table] |= own
    parts: dict[str, str] = data["parts"] | {
        f"{table}_{key}": text
        for table, own in data["phrases"].items()
        for key, text in own.items()
    }

    def whole(text: str) -> str:
        while "$" in text:
            text = Template(text).substitute(parts)
        return text

    def saying(record: Mapping[str, Any]) -> FindingText:
        what, evidence, do = (whole(record.get(key, "")) for key in _TEXTS)
        return FindingText(what, evidence, do)

    finding_texts: dict[tuple[str, str], FindingText] = {}
    for code, own in data["say"].items():
        if "what" in own:
            finding_texts[code, ""] = saying(own)
        for case, record in own.items():
            if isinstance(record, dict):
                finding_texts[code, case] = saying(record)
    phrases = {
        table: {key: whole(text) for key, text in own.items()}
        for table, own in data["phrases"].items()
    }
    checks = {key: whole(text) for key, text in data["checks"].items()}
    return Catalogue(
        finding_texts, data["because"], phrases, data["events"], checks, data["options"]
    )
