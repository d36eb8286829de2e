"""Frames with what was found drawn on them: the contact sheet, the preview, and the frames kept to find out why."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from slamduel.bench.detect.kept_frames import MOST, PICTURES, STRETCHES, ContactSheet, EmptyFrames, sheet
from slamduel.bench.detect.marker_frames import annotated
from slamduel.bench.detect.preview import Preview
from slamduel.core.errors import InputError
from slamduel.frontend.markers.aruco import Rejections
from slamduel.frontend.markers.pipeline import Frame, FrameSightings, build_log
from small_recording import picture, sighting, small_recording


def film(preview: Preview) -> Callable[[FrameSightings], None]:
    return lambda seen: preview.add(seen.frame.t, annotated(seen))


def frames_of(path: Path) -> int:
    """The frames of a video that OpenCV reads."""
    video, frames = cv2.VideoCapture(str(path)), 0
    while video.read()[0]:
        frames += 1
    video.release()
    return frames


@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".mkv", ".webm"])
def test_the_preview_is_a_video_of_every_frame(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"preview{suffix}"
    recording, _ = small_recording(np.random.default_rng(0))
    with Preview(path) as preview:
        build_log(recording, film(preview))
        assert not path.exists()
    assert frames_of(path) == 60
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(5, rel=0.01)
    video.release()
    assert list(tmp_path.iterdir()) == [path]


def test_a_preview_is_whole_or_not_there(tmp_path: Path) -> None:
    recording, _ = small_recording(np.random.default_rng(0), 1)
    with Preview(tmp_path / "one.mp4") as preview:
        build_log(recording, film(preview))
    assert frames_of(tmp_path / "one.mp4") == 1
    late = replace(
        small_recording(np.random.default_rng(0))[0],
        frames=[Frame(0.0, picture(0)), Frame(0.5, picture(1)), Frame(0.1, picture(2))],
    )
    with pytest.raises(InputError, match="expected later"), Preview(tmp_path / "two.mp4") as preview:
        build_log(late, film(preview))
    assert [one.name for one in tmp_path.iterdir()] == ["one.mp4"]


def seen_of(number: int, kept: int, rejected: int) -> FrameSightings:
    sightings = [sighting(name, 1.0, 0.0) for name in range(kept)]
    z = np.tile([1.0, 0.0], (kept, 1))
    frame = Frame(0.1 * number, picture(number))
    return FrameSightings(
        frame,
        sightings,
        z,
        np.tile(np.eye(2), (kept, 1, 1)),
        np.ones(kept, bool),
        Rejections(why=rejected),
        np.zeros(kept),
        np.zeros((kept, 2, 2)),
    )


@pytest.mark.parametrize("frames", [1, 5, 12, 100, 1000])
def test_the_contact_sheet_is_spread_and_varied(frames: int) -> None:
    contact = ContactSheet()
    for k in range(frames):
        contact.observe(seen_of(k, 0 if k % 50 == 20 else 1 + k % 3, int(k % 70 == 30)))
        assert len(contact) <= 4 * STRETCHES
    chosen = contact.pictures()
    numbers = [one.number for one in chosen]
    assert numbers == sorted(set(numbers))
    assert len(chosen) == min(frames, PICTURES) or frames == 12
    assert max(np.diff([-1, *numbers, frames])) <= max(2, frames / 3)
    if frames >= 100:
        assert any(one.rejected for one in chosen)
        assert any(not one.kept for one in chosen)
        assert sum(one.kept == 3 for one in chosen) >= 4
    height, width = sheet(chosen).shape[:2]
    assert width <= 4 * 490
    assert height <= 3 * 370 + 10


def test_outlines_are_where_the_corners_are() -> None:
    contact = ContactSheet()
    contact.observe(seen_of(0, 1, 0))
    (chosen,) = contact.pictures()
    corners = (sighting(0, 1.0, 0.0).corners + 0.5) * 1.5 - 0.5  # 320 px become 480
    colourful = np.ptp(chosen.image.astype(int), axis=2) > 60
    v, u = np.nonzero(colourful)
    np.testing.assert_allclose([u.min(), v.min()], corners.min(axis=0), atol=6)
    np.testing.assert_allclose([u.max(), v.max()], corners.max(axis=0), atol=6)


def test_empty_frames_stay_few_and_spread() -> None:
    empty = EmptyFrames()
    for k in range(3000):
        empty.observe(seen_of(k, k % 2, 0))
    numbers = [256 * int(image[0, 0]) + int(image[0, 1]) for image in empty.images]
    assert MOST // 2 <= len(numbers) <= MOST
    assert all(number % 2 == 0 for number in numbers)
    assert max(np.diff([*numbers, 3000])) < 3000 / 5
