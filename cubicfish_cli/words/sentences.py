"""Findings, events and errors in sentences, for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from cubicfish import CubicfishError, Event, Finding, listed
from cubicfish.judge.codes import Code
from cubicfish.judge.finding import FindingText
from cubicfish_cli.words.catalogue import catalogue
from cubicfish_cli.words.phrases import Sentences

if TYPE_CHECKING:
    from cubicfish.judge import FitRecord

_SENTENCES = Sentences()
_OF_RIGS = (
    Code.SHOT_MISMATCHED,
    Code.CAMERA_MOVED,
    Code.FEW_COMMON_SHOTS,
    Code.CLOCKS_DIFFER,
    Code.NOT_AT_ONCE,
    Code.SHOT_APART,
    Code.RIG_STRAINED,
    Code.PLACE_UNCERTAIN,
)


def render(finding: Finding) -> FindingText:
    """Write the sentences of a finding, unless it has some; of no known code, its facts."""
    if finding.text is not None:
        return finding.text
    known, code, case = catalogue(), finding.code, finding.case
    if (
        "photos" in finding.figures
        and (code, "all") in known.finding_texts
        and code != Code.NO_MARKERS
    ):
        case = "grid_all" if case == "grid" else "all"
    saying = known.finding_texts.get((code, case))
    if saying is None:
        return FindingText(str(finding))
    values = {
        name: render(one) if isinstance(one, Finding) else one
        for name, one in finding.figures.items()
    }
    values |= {"images": finding.images, "boards": finding.boards}
    if finding.cameras:
        values |= {"cameras": finding.cameras, "of_shots": finding.shots}
    for name in known.phrases.keys() & finding.figures.keys():
        values[name] = _write_part(name, values[name], values)
    evidence = known.because[finding.because] if finding.because else saying.evidence
    what, evidence, do = (_fill_in(text, values) for text in (saying.what, evidence, saying.do))
    if finding.cameras and finding.code not in _OF_RIGS:
        what = f"camera {finding.cameras[0]}: {what}"
    return FindingText(what, evidence, do)


def render_short(finding: Finding) -> str:
    """Write a finding in fewer words, where there is little room."""
    if (finding.code, "short") in catalogue().finding_texts:
        return render(replace(finding, case="short", text=None)).what
    return render(finding).line


def render_event(event: Event, figures: Mapping[str, Any]) -> str:
    """Write what is said of an event while work is done."""
    return _SENTENCES.vformat(catalogue().events[event], (), figures)


def render_error(error: CubicfishError) -> str:
    """Write an error as a command line says it, with options in the place of arguments."""
    return error.text(
        catalogue().options, lambda finding: (render(finding).why, render(finding).do)
    )


def with_text(finding: Finding) -> Finding:
    """Return the finding with its sentences, as files and JSON have it."""
    inner = {
        name: with_text(value) if isinstance(value, Finding) else value
        for name, value in finding.figures.items()
    }
    return replace(finding, figures=inner, text=render(finding))


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


def _fill_in(template: str, values: Mapping[str, Any]) -> str:
    # The lone board of --board is named so.
    return _SENTENCES.vformat(template, (), values).replace("board board", "the board")


def _write_part(name: str, value: Any, values: Mapping[str, Any]) -> str:
    """Return the part of a sentence for a figure: one phrase, or a list of records' phrases."""
    phrases = catalogue().phrases[name]
    if isinstance(value, str):
        return _SENTENCES.vformat(phrases[value], (), values)
    written = [_SENTENCES.vformat(phrases[one["form"]], (), one) for one in value]
    return listed(written, name)
