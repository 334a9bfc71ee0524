"""JSON from files that nobody vouches for: no key twice, and finite numbers only."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any, NoReturn

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.wording import quoted

MAX_VALUES = 2_000_000


def json_text(data: Any) -> str:
    """Plain data as the text of a file, finite numbers only."""
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def parse_plain_json(path: Path, text: str) -> Any:
    """What the text of a file holds; ``path`` is for messages.

    Raises:
        CameraFileError: it is not JSON, a key is there twice, a number is not one, or there are
            more than :data:`MAX_VALUES`; one line.

    """
    if sum(map(text.count, ",[{")) > MAX_VALUES:
        raise CameraFileError(
            f"{path} holds more than {MAX_VALUES:,} values: is it the right file?"
        )

    def refuse_constant(name: str) -> NoReturn:
        raise CameraFileError(f"{path}: {name} is not a finite number")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        data = dict(pairs)
        if len(data) < len(pairs):
            twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
            raise CameraFileError(f"{path}: the key {quoted(twice)} is there twice")
        return data

    try:
        return json.loads(text, parse_constant=refuse_constant, object_pairs_hook=unique)
    except CameraFileError:
        raise
    except json.JSONDecodeError as problem:
        raise CameraFileError(
            f"{path}, line {problem.lineno}: not valid JSON: {problem.msg}"
        ) from problem
    except (ValueError, RecursionError) as problem:  # a number of many digits; deep nesting
        raise CameraFileError(f"{path}: not the JSON of a camera") from problem
