"""Definitions of messages that are not among ROS's own: detected tags."""

from typing import Any

APRILTAG = "apriltag_msgs/msg/AprilTagDetectionArray"
APRILTAG_ROS = "apriltag_ros/msg/AprilTagDetectionArray"
ISAAC = "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray"

_ARRAY = "std_msgs/Header header\nAprilTagDetection[] detections\n"
_POINT = "float64 x\nfloat64 y\n"

DEFINITIONS = {
    "apriltag_msgs/msg/Point": _POINT,
    "apriltag_msgs/msg/AprilTagDetection": (
        "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
        "apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography\n"
    ),
    APRILTAG: _ARRAY,
    "apriltag_ros/msg/AprilTagDetection": "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\n",
    APRILTAG_ROS: _ARRAY,
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetection": (
        "string family\nint32 id\ngeometry_msgs/Point center\ngeometry_msgs/Point[4] corners\n"
        "geometry_msgs/PoseWithCovarianceStamped pose\n"
    ),
    ISAAC: _ARRAY,
}
"""Type -> its definition, without comments."""


def register(types: Any, name: str, definition: str) -> None:
    """Adds the type `name` to rosbags' `types`, by a bag's own `definition` or else, if it is empty, by ours."""
    from rosbags.typesys import get_types_from_msg

    if name not in (APRILTAG, APRILTAG_ROS, ISAAC) or name in types.types:
        return
    if definition:
        found = get_types_from_msg(definition, name)
    else:
        package = name.split("/", maxsplit=1)[0]
        found = dict[str, Any]()
        for part, text in DEFINITIONS.items():
            if part.startswith(f"{package}/"):
                found |= get_types_from_msg(text, part)
    types.register({key: value for key, value in found.items() if key not in types.types})
