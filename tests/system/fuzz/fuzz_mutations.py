"""Damage to files, of the kinds that people, other programs and enemies do."""

import random
import re
from collections.abc import Sequence

from fuzz_readers import WORDS

_TOKEN = re.compile(rb"[-+.\w]+")
LONGEST = 200_000


def mutated(seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    """One of the seeds with one to six damages."""
    data = rng.choice(seeds)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        data = rng.choice(_DAMAGES)(data, seeds, (*words, *WORDS), rng)[:LONGEST]
    return data


def _token(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    """A word or number becomes another one."""
    tokens = list(_TOKEN.finditer(data))
    if not tokens:
        return data
    at = rng.choice(tokens)
    other = rng.choice((_word(words, rng), rng.choice(tokens).group(), _number(rng)))
    return data[: at.start()] + other + data[at.end() :]


def _line(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    """A line goes, comes twice, moves, or is pushed to the right."""
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    line = lines[at]
    what = rng.randrange(5)
    if what == 0:
        del lines[at]
    elif what == 1:
        lines.insert(at, line)
    elif what == 2:
        lines.insert(rng.randrange(len(lines)), lines.pop(at))
    elif what == 3:
        lines[at] = b"  " * rng.choice((1, 2, 300)) + line
    else:
        lines[at] = line * rng.choice((2, 10, 1000))
    return b"\n".join(lines)


def _insert(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    times = rng.choice((1, 1, 1, 20, 3000))
    return data[:at] + _word(words, rng) * times + data[at:]


def _byte(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    if not data:
        return data
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 4, 40))):
        at = rng.randrange(len(changed))
        changed[at] = rng.choice((0, 255, changed[at] ^ 1 << rng.randrange(8), rng.randrange(256)))
    return bytes(changed)


def _header(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    """Counts and sizes in binary files stand near the front or the end."""
    if len(data) < 8:
        return data
    changed = bytearray(data)
    at = rng.randrange(min(len(data), 64)) if rng.random() < 0.7 else rng.randrange(len(data))
    size = rng.choice((1, 2, 4))
    value = rng.choice((0, 1, 127, 128, 255, 65535, 2**31 - 1, 2**31, 2**32 - 1, 100_000))
    changed[at : at + size] = (value % 256**size).to_bytes(size, rng.choice(("big", "little")))
    return bytes(changed)


def _cut(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    start, end = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    return rng.choice((data[:end], data[start:], data[:start] + data[end:]))


def _splice(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    other = rng.choice(seeds)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def _encode(data: bytes, seeds: Sequence[bytes], words: Sequence[str], rng: random.Random) -> bytes:
    """Other programs' line ends, marks of byte order and encodings."""
    what = rng.randrange(5)
    if what == 0:
        return data.replace(b"\n", b"\r\n")
    if what == 1:
        return b"\xef\xbb\xbf" + data
    if what == 2:
        return data.decode("latin-1").encode("utf-16")
    if what == 3:
        return data.replace(b"\n", b"\r")
    return data.replace(b".", b",")


_DAMAGES = (_token, _token, _token, _line, _line, _insert, _byte, _header, _cut, _splice, _encode)


def _word(words: Sequence[str], rng: random.Random) -> bytes:
    return rng.choice(words).encode("utf-8", "surrogatepass")


def _number(rng: random.Random) -> bytes:
    return rng.choice(
        (
            str(rng.randrange(-3, 40)),
            repr(rng.uniform(-1, 1) * 10.0 ** rng.randrange(-12, 13)),
            "9" * rng.choice((5, 400, 5000)),
            "0." + "3" * 400,
        )
    ).encode()
