"""Reads ROS 2 bags whose metadata.yaml differs from their files in what does not matter for their messages.

rosbags asks for a known storage, which `ros2 bag reindex` of ROS humble leaves empty (rosbag2 2175), and pairs the
topics of metadata.yaml with those of the files by their quality of service, too, which is edited by hand where a newer
ROS wrote it (rosbag2 656).
"""

from collections.abc import Collection, Generator
from typing import Any, ClassVar

from rosbags.rosbag2 import Reader as AnyReader
from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.reader import DirectoryReader


def _by_suffix(path: Any) -> Any:
    """The storage of a file whose metadata.yaml does not name a known one."""
    plugin = AnyReader.STORAGE_PLUGINS.get(path.suffix)
    if plugin is None:
        raise ReaderError(f"{path.name} is neither .mcap nor .db3, and metadata.yaml names no known storage_identifier")
    return plugin(path)


class _Storages(dict[str | None, Any]):
    """The storages by name; any other name stands for that of the file's suffix."""

    def __contains__(self, key: object) -> bool:
        return True

    def __missing__(self, key: str | None) -> Any:
        return _by_suffix


class _Folder(DirectoryReader):
    STORAGE_PLUGINS: ClassVar[Any] = _Storages({**DirectoryReader.STORAGE_PLUGINS})  # ty: ignore[incompatible-attribute-override]

    def open(self) -> None:
        super().open()
        inside = [one for storage in self.storages for one in storage.connections]
        for row, one in enumerate(self.connections):
            same = [other for other in inside if (other.topic, other.msgtype) == (one.topic, one.msgtype)]
            if same and not any(other.ext == one.ext and other.digest == one.digest for other in same):
                self.connections[row] = one._replace(ext=same[0].ext, digest=same[0].digest)

    def messages(
        self, connections: Collection[Any], start: int | None = None, stop: int | None = None
    ) -> Generator[Any]:
        some = False
        for message in super().messages(connections, start, stop):
            some = True
            yield message
        listed = next((one for one in connections if one.msgcount), None)
        if not some and listed is not None:
            raise ReaderError(
                f"metadata.yaml does not fit its files: none of the {listed.msgcount} messages of topic {listed.topic} "
                "that it lists is in them"
            )


class Reader(AnyReader):
    """A reader of a folder or a file."""

    STORAGE_PLUGINS: ClassVar[Any] = {**AnyReader.STORAGE_PLUGINS, "dir": _Folder}  # ty: ignore[incompatible-attribute-override]
