"""Whether two runs gave the same.

Files are equal byte for byte. The last bits of a fit depend on how a process's memory happens to
be aligned: there, and only there, numbers may differ by a billionth.
"""

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

_CLOSE = 1e-9
_NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def same_files(one: Path, two: Path) -> bool:
    """Whether all numbers in two files are the same to a billionth, and all else to the byte."""
    first, second = one.read_bytes(), two.read_bytes()
    if first == second:
        return True
    if one.suffix == ".npz":
        return _same_arrays(first, second)
    return _same_texts(first, second)


def same_records(one: Any, two: Any) -> bool:
    """Whether two records of plain data say the same, as they are told in JSON."""
    return _same_texts(json.dumps(one).encode(), json.dumps(two).encode())


def _same_texts(first: bytes, second: bytes) -> bool:
    if _NUMBER.sub(b"", first) != _NUMBER.sub(b"", second):
        return False
    return bool(np.allclose(_numbers(first), _numbers(second), rtol=_CLOSE, atol=_CLOSE))


def _numbers(data: bytes) -> np.ndarray:
    return np.array([float(number) for number in _NUMBER.findall(data)])


def _same_arrays(first: bytes, second: bytes) -> bool:
    with np.load(io.BytesIO(first)) as one, np.load(io.BytesIO(second)) as two:
        if sorted(one) != sorted(two):
            return False
        for name in one:
            a, b = one[name], two[name]
            if a.dtype != b.dtype or a.shape != b.shape:
                return False
            if a.dtype.kind == "U":
                if not _same_texts(str(a).encode(), str(b).encode()):
                    return False
                continue
            if not np.allclose(a, b, rtol=_CLOSE, atol=_CLOSE):
                return False
    return True
