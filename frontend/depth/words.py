"""A bag of words: which keyframes have features like those of a new one, at a cost that hardly grows.

Sivic and Zisserman, ICCV 2003, with words of bits by majority (Galvez-Lopez and Tardos, T-RO 2012). The words are those
of the drive itself: there are none until there are enough keyframes to choose them from, and no files to load.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ._bits import Bits, moved, nearest
from .features import bits_of
from .pairs import Keyframe
from .settings import Settings

WORDS, ROUNDS, SAMPLE = 512, 6, 12_000
"""Number of words; rounds of k-majority, and descriptors that they are found among."""


class Words:
    """The words of the keyframes that loops are searched in."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._vocabulary: Bits | None = None
        self._middle: NDArray[Any] | None = None  # above which a number is a set bit
        self._counts: list[NDArray[np.float32]] = []

    def add(self, places: Sequence[Keyframe]) -> None:
        """Takes the last of `places`; from the first one too many to search them all, there are words."""
        if len(places) <= self._settings.by_words:
            return
        if self._vocabulary is None:
            self._learn([place.features.descriptors for place in places])
        for place in places[len(self._counts) :]:
            self._counts.append(self._counted(place.features.descriptors))

    def best(self, descriptors: NDArray[Any], rows: Sequence[int], count: int) -> list[int]:
        """The `count` of places `rows` whose words are most like those of `descriptors` (n, d)."""
        all_ = np.array(self._counts)
        rarity = np.log(len(all_) / (1.0 + (all_ > 0).sum(axis=0))).clip(0.05)
        mine = self._counted(descriptors) * rarity
        others = all_[rows] * rarity
        length = np.sqrt((others**2).sum(axis=1) * (mine**2).sum()) + 1e-12
        alike: Array = others @ mine / length
        return [rows[k] for k in np.argsort(-alike, kind="stable")[:count]]

    def _learn(self, descriptors: Sequence[NDArray[Any]]) -> None:
        """Finds the words by k-majority, from descriptors that are drawn with a seed of their own."""
        rng, all_ = np.random.default_rng(0), np.concatenate(descriptors)
        sample = all_[np.sort(rng.permutation(len(all_))[:SAMPLE])]
        if sample.dtype != np.uint8:
            self._middle = np.median(sample, axis=0)
        bits = self._bits(sample)
        words = bits[np.sort(rng.permutation(len(bits))[:WORDS])].copy()
        at = np.zeros(len(bits), np.int64)
        for _ in range(ROUNDS):
            nearest(bits, words, at)
            moved(bits, at, words)
        self._vocabulary = words

    def _counted(self, descriptors: NDArray[Any]) -> NDArray[np.float32]:
        """(m,) the share of each word among descriptors."""
        assert self._vocabulary is not None
        at = np.zeros(len(descriptors), np.int64)
        nearest(self._bits(descriptors), self._vocabulary, at)
        return (np.bincount(at, minlength=len(self._vocabulary)) / max(len(at), 1)).astype(np.float32)

    def _bits(self, descriptors: NDArray[Any]) -> Bits:
        """(n, w) descriptors as bits; one of numbers has a bit set where it is above the median."""
        if self._middle is not None:
            descriptors = np.packbits(descriptors > self._middle, axis=1)
        return bits_of(descriptors)
