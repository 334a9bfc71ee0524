"""The sentences of ``catalogue.toml``, and those of extensions, read once."""

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

from cubicfish import CubicfishError, Event, listed
from cubicfish.judge.codes import Code, Remedy
from cubicfish.judge.finding import FindingText
from cubicfish_cli.extension_guard import extensions
from cubicfish_cli.words.phrases import Sentences

_FILE = Path(__file__).with_name("catalogue.toml")
_TEXTS = ("what", "evidence", "do")
_SENTENCES = Sentences()


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
        return FindingText(what, evidence, do, Remedy(record["remedy"]))

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


def has(code: Code, case: str) -> bool:
    """Return whether a finding has sentences of this form."""
    return (code.value, case) in catalogue().finding_texts


def write_text(code: Code, case: str, because: str, figures: Mapping[str, Any]) -> FindingText:
    """Return the sentences of a finding, with its figures in them."""
    known = catalogue()
    saying = known.finding_texts[code, case]
    values = dict(figures)
    for name in known.phrases.keys() & figures.keys():
        values[name] = _write_part(name, values[name], values)
    evidence = known.because[because] if because else saying.evidence
    texts = (_SENTENCES.vformat(text, (), values) for text in (saying.what, evidence, saying.do))
    # The lone board of --board is named so.
    what, evidence, do = (text.replace("board board", "the board") for text in texts)
    return FindingText(what, evidence, do, saying.remedy)


def write_event(event: Event, figures: Mapping[str, Any]) -> str:
    """Return the sentence for an event while work is done."""
    return _SENTENCES.vformat(catalogue().events[event], (), figures)


def write_error(error: CubicfishError) -> str:
    """Say an error at a command line, with its options in the place of arguments."""
    return error.text(catalogue().options) if error.arguments else str(error)


def _write_part(name: str, value: Any, values: Mapping[str, Any]) -> str:
    """Return the part of a sentence for a figure: one phrase, or a list of records' phrases."""
    phrases = catalogue().phrases[name]
    if isinstance(value, str):
        return _SENTENCES.vformat(phrases[value], (), values)
    written = [_SENTENCES.vformat(phrases[one["form"]], (), one) for one in value]
    return listed(written, name)
