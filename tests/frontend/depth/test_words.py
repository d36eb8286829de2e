"""Matches and words of descriptors, against plain counts of bits and numbers."""

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from slamduel.frontend.depth._bits import moved, nearest
from slamduel.frontend.depth.features import Features, bits_of, matched
from slamduel.frontend.depth.level import Level
from slamduel.frontend.depth.pairs import Keyframe
from slamduel.frontend.depth.points import Points
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.depth.words import Words

Bytes = NDArray[np.uint8]


def some(rng: np.random.Generator, n: int) -> Bytes:
    return rng.integers(0, 256, (n, 32)).astype(np.uint8)


def noisy(rng: np.random.Generator, descriptors: Bytes, share: float) -> Bytes:
    """The same with so many of their bits turned."""
    return descriptors ^ np.packbits(rng.random((len(descriptors), 256)) < share, axis=1)


def by_opencv(first: NDArray[Any], second: NDArray[Any], norm: int, ratio: float) -> list[list[int]]:
    """Lowe's ratio by OpenCV's matcher, then one to one."""
    pairs = cv2.BFMatcher(norm).knnMatch(first, second, k=2)
    clear = [(a.queryIdx, a.trainIdx) for a, b in pairs if a.distance < ratio * b.distance]
    ends = [b for _, b in clear]
    return [[a, b] for a, b in clear if ends.count(b) == 1]


def test_matches_of_bits_are_those_of_opencv() -> None:
    rng = np.random.default_rng(1)
    first = some(rng, 120)
    second = np.concatenate((noisy(rng, first[:80], 0.08), some(rng, 50), noisy(rng, first[:10], 0.08)))
    second = second[rng.permutation(len(second))]
    found = matched(first, second, 0.8)
    assert len(found) > 60
    assert found.tolist() == by_opencv(first, second, cv2.NORM_HAMMING, 0.8)


def test_matches_of_numbers_are_those_of_opencv() -> None:
    rng = np.random.default_rng(2)
    first = rng.uniform(0, 100, (60, 128)).astype(np.float32)
    second = np.concatenate((first[:40] + rng.normal(0, 3, (40, 128)), rng.uniform(0, 100, (20, 128)))).astype("f4")
    assert matched(first, second, 0.8).tolist() == by_opencv(first, second, cv2.NORM_L2, 0.8)


@pytest.mark.parametrize(("n", "m"), [(0, 5), (5, 0), (5, 1)])
def test_too_few_descriptors_have_no_matches(n: int, m: int) -> None:
    rng = np.random.default_rng(0)
    assert matched(some(rng, n), some(rng, m), 0.8).shape == (0, 2)


def test_nearest_words_and_majorities_are_those_of_unpacked_bits() -> None:
    rng = np.random.default_rng(4)
    descriptors, words = some(rng, 200), some(rng, 15)
    at = np.zeros(200, np.int64)
    vocabulary = bits_of(words).copy()
    nearest(bits_of(descriptors), vocabulary, at)
    bits, centres = np.unpackbits(descriptors, axis=1), np.unpackbits(words, axis=1)
    expected = (bits[:, None] != centres[None]).sum(axis=2).argmin(axis=1)
    np.testing.assert_array_equal(at, expected)
    moved(bits_of(descriptors), at, vocabulary)
    for k in range(15):
        mine = bits[expected == k]
        majority = 2 * mine.sum(axis=0) > len(mine) if len(mine) else centres[k]
        np.testing.assert_array_equal(np.unpackbits(vocabulary[k].view(np.uint8)), majority)


@pytest.mark.parametrize("kind", ["orb", "sift"])
def test_words_choose_the_places_that_were_seen_before(kind: str) -> None:
    rng, settings = np.random.default_rng(6), Settings(features=kind)
    settings_few = _few(settings, 20)
    if kind == "orb":
        views = [some(rng, 80) for _ in range(30)]
        again = [noisy(rng, view, 0.05) for view in views]
    else:
        views = [rng.uniform(0, 100, (80, 128)).astype(np.float32) for _ in range(30)]
        again = [view + rng.normal(0, 3, view.shape).astype(np.float32) for view in views]
    places, words = list[Keyframe](), Words(settings_few)
    for k, view in enumerate(views):
        places.append(_keyframe(k, view))
        words.add(places)
    found = [words.best(view, range(30), 3) for view in again]
    assert all(k in best for k, best in enumerate(found))
    assert all(len(set(best)) == 3 for best in found)
    assert words.best(again[4], [1, 2, 9], 2) != [4]  # of those that may be chosen
    assert set(words.best(again[4], [1, 2, 9], 2)) <= {1, 2, 9}


def _few(settings: Settings, count: int) -> Settings:
    """Settings by which words choose among more than so many places."""
    object.__setattr__(settings, "by_words", count)
    return settings


def _keyframe(step: int, descriptors: NDArray[Any]) -> Keyframe:
    n = len(descriptors)
    points = Points(np.zeros((n, 2)), np.ones(n), np.ones(n), np.ones(n))
    features = Features(np.zeros((n, 2)), points, descriptors)
    level = Level(np.eye(4), np.eye(3), True)
    return Keyframe(step, float(step), features, level, np.zeros((2, 2), np.float32), np.full(n, -1))
