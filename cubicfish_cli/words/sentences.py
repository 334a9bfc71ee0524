"""Findings, events and errors in sentences, for people."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from inspect import signature
from typing import TYPE_CHECKING, Any

from cubicfish import CubicfishError, Finding
from cubicfish.judge import FindingText
from cubicfish_cli.extension_guard import Place, extensions
from cubicfish_cli.words import events, fit, photos, points, set_up
from cubicfish_cli.words.table import Words

if TYPE_CHECKING:
    from cubicfish.judge import FitRecord


@cache
def all_words() -> Words:
    """The functions of the program and of its extensions."""
    places = [Place(name, one.words) for name, one in extensions().items() if one.words is not None]
    more = [words for place in places if (words := place.load_or_leave_out(Words)) is not None]
    every = Words()
    # No extension says the program's own sentences otherwise.
    for words in (*more, set_up.WORDS, fit.WORDS, points.WORDS, photos.WORDS, events.WORDS):
        every.findings.update(words.findings)
        every.evidence.update(words.evidence)
        every.events.update(words.events)
    return every


@cache
def parameters(function: Callable[..., Any]) -> frozenset[str]:
    """The names of the figures that a sentence needs."""
    return frozenset(signature(function).parameters)


def _write(function: Callable[..., Any], figures: Mapping[str, Any]) -> Any:
    return function(**{name: figures[name] for name in parameters(function) & figures.keys()})


def render(finding: Finding) -> FindingText:
    """Write the sentences of a finding, unless it has some; of no known code, its facts."""
    if finding.text is not None:
        return finding.text
    known = all_words()
    write = known.findings.get((finding.code, finding.case))
    if write is None:
        return FindingText(str(finding))
    figures = {
        name: render(value) if isinstance(value, Finding) else value
        for name, value in finding.figures.items()
    }
    figures |= {name: getattr(finding, name) for name in ("code", "case", "images", "boards")}
    figures |= {"board": finding.boards[0]} if finding.boards else {}
    of_several = isinstance(write, FindingText) or "cameras" not in parameters(write)
    figures |= {"cameras": finding.cameras, "of_shots": finding.shots}
    what, evidence, do = write if isinstance(write, FindingText) else _write(write, figures)
    if finding.because:
        evidence = _write(known.evidence[finding.because], figures)
    if finding.cameras and of_several:  # it is about one camera of a rig, alone
        what = f"camera {finding.cameras[0]}: {what}"
    return FindingText(*map(_name_the_lone_board, (what, evidence, do)))


def _name_the_lone_board(sentence: str) -> str:
    """That of --board is named so."""
    return sentence.replace("board board", "the board")


def render_short(finding: Finding) -> str:
    """Write a finding in fewer words, where there is little room."""
    if (finding.code, "short") in all_words().findings:
        return render(replace(finding, case="short", text=None)).what
    return render(finding).line


def render_event(event: str, figures: Mapping[str, Any]) -> str:
    """Write what is said of an event while work is done."""
    return str(_write(all_words().events[event], figures))


def render_error(error: CubicfishError) -> str:
    """Write an error as a command line says it, with options in the place of arguments."""

    def tell(finding: Finding) -> tuple[str, str]:
        text = render(finding)
        return text.why, text.do

    return error.text(events.OPTIONS, tell)


def with_text(finding: Finding) -> Finding:
    """Return the finding with its sentences, as files and JSON have it."""
    figures = {
        name: with_text(value) if isinstance(value, Finding) else value
        for name, value in finding.figures.items()
    }
    return replace(finding, figures=figures, text=render(finding))


def record_of(finding: Finding) -> dict[str, Any]:
    """Return plain data for JSON, sentences included."""
    return with_text(finding).as_record()


def with_texts(fit: FitRecord) -> FitRecord:
    """Return the record of a fit with the sentences of its findings."""
    return replace(
        fit,
        findings=tuple(map(with_text, fit.findings)),
        unfit_images={photo: with_text(why) for photo, why in fit.unfit_images.items()},
    )
