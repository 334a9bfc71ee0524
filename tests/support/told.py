"""Errors as the command line tells them."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from cubicfish import CubicfishError
from cubicfish_cli.words.sentences import render_error


@contextmanager
def raises_told(
    kind: type[CubicfishError], match: str
) -> Iterator[pytest.ExceptionInfo[CubicfishError]]:
    """Expect an error, with these words of its findings."""
    with pytest.raises(kind) as caught:
        yield caught
    text = render_error(caught.value)
    assert re.search(match, text), text
