"""The tables of a robot's cameras in robot.toml: [camera] of an only one, or [camera.left] and the like of several."""

from dataclasses import dataclass, replace
from typing import Any

from ...core.toml.table import TomlTable
from ..robot_tables import calibrated, pose_in

CAMERA = ("calibration", "size", "mounting", "time_offset", "exposure", "readout", "rectified")
"""Keys of a camera."""

TOPICS = {"topic": "image", "camera_info": "camera_info"}
"""Keys of one of several in a bag -> those of [topics] for an only one; `topic` may have tags, too."""


@dataclass(frozen=True)
class FrameSource:
    """Location and times of the frames, unless frames.csv has them."""

    source: str | None = None  # the recording, relative to the folder of robot.toml; None: the only one there
    fps: float | None = None  # frames per second
    start: float = 0.0  # s, the time of the first frame, with `fps`


def table_of(name: str) -> str:
    """The table of an only camera, or of the one called `name`."""
    return f"[camera.{name}]" if name else "[camera]"


def of_camera(camera: TomlTable, name: str = "") -> dict[str, Any]:
    """The table of a camera as arguments of a Robot; `name` is that of one of several."""
    placed, readout = pose_in(camera, "mounting"), camera.number("readout", 0.0, least=0)
    lens = calibrated(camera, placed)
    return {
        "camera": None if lens is None else replace(lens, readout=readout, name=name),
        "mounting": placed,
        "time_offset": camera.number("time_offset", 0.0),
        "exposure": camera.number("exposure", 0.0, least=0),
        "readout": readout,
        "rectified": camera.switch("rectified", False) if camera.has("rectified") else None,
    }


def frames_in(table: TomlTable) -> FrameSource:
    """The location and times of frames in a table."""
    return FrameSource(
        source=table.text_or_none("source"),
        fps=table.number("fps", above=0) if table.has("fps") else None,
        start=table.number("start", 0.0),
    )
