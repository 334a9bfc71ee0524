"""Rigs in words."""

from dataclasses import replace

from cubicfish import Rig
from cubicfish_cli.words.sentences import with_text, with_texts


def rig_with_texts(rig: Rig) -> Rig:
    """A rig with the sentences of all its findings, as its files have them."""
    return replace(
        rig,
        fit=replace(rig.fit, findings=tuple(map(with_text, rig.fit.findings))),
        cameras=tuple(replace(one, fit=with_texts(one.fit)) for one in rig.cameras),
    )
