"""Damaged files, which every reader has to accept or refuse with one sentence."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np

from slamduel.core.errors import InputError

T = TypeVar("T")

WORDS = (*b"nan inf -1 1e400 1e-320 99999999999999999999 0x10 \xff\xfe \0 ,".split(), b" ", b"#")
"""Plausible output of other programs in place of a number."""


def damaged(content: bytes, cases: int, seed: int) -> Iterator[bytes]:
    """Yields damaged copies of `content`: bits flipped, truncated, lines lost, doubled, swapped, cells changed."""
    rng = np.random.default_rng(seed)
    kinds = (_bits, _cut, _lost, _doubled, _swapped, _word)
    for case in range(cases):
        yield kinds[case % len(kinds)](content, rng)


def survivors(
    read: Callable[[Path], T], path: Path, cases: int, seed: int, fit: Callable[[T], object] | None = None
) -> tuple[list[T], list[str]]:
    """Reads that many damaged copies of the file `path`; returns the results, and the messages of those refused.

    Anything but an InputError fails the test, as does an error of `fit` on a result. Messages are one line and name the
    file or the folder.
    """
    content = path.read_bytes()
    found, sentences = list[T](), list[str]()
    try:
        for broken in damaged(content, cases, seed):
            path.write_bytes(broken)
            try:
                one = read(path)
            except InputError as error:
                sentence = str(error)
                assert sentence[-1] in ".?", sentence
                assert "\n" not in sentence, sentence
                assert path.name in sentence or str(path.parent) in sentence, sentence
                sentences.append(sentence)
            else:
                if fit is not None:
                    fit(one)
                found.append(one)
    finally:
        path.write_bytes(content)
    return found, sentences


def _bits(content: bytes, rng: np.random.Generator) -> bytes:
    broken = bytearray(content)
    for place in rng.integers(len(broken), size=rng.integers(1, 5)):
        broken[place] ^= 1 << int(rng.integers(8))
    return bytes(broken)


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content))]


def _lost(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    del lines[int(rng.integers(len(lines)))]
    return b"".join(lines)


def _doubled(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    k = int(rng.integers(len(lines)))
    return b"".join(lines[: k + 1] + lines[k:])


def _swapped(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    one, other = rng.integers(len(lines), size=2)
    lines[one], lines[other] = lines[other], lines[one]
    return b"".join(lines)


def _word(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    k = int(rng.integers(len(lines)))
    comma = b"," in lines[k]
    cells = lines[k].split(b"," if comma else None)
    if cells:
        cells[int(rng.integers(len(cells)))] = WORDS[int(rng.integers(len(WORDS)))]
    lines[k] = (b"," if comma else b" ").join(cells).rstrip(b"\n") + b"\n"
    return b"".join(lines)
