"""Chooses a bag's topics: the one that is named, else the only one of its type."""

from collections.abc import Collection, Sequence
from pathlib import Path

from ...core.errors import InputError
from .bag import Topic


def choose(
    path: Path, listed: Sequence[Topic], named: str | None, setting: str, types: tuple[str, ...]
) -> Topic | None:
    """The topic `named`, or else the only one with messages of `types`; None if there is none.

    `setting` is what names it, such as "[topics] image". InputError for a topic that is missing, of another type or
    without messages, and for several.
    """
    expected = " or ".join(map(plain, types))
    if named is not None:
        topic = next((topic for topic in listed if topic.name.strip("/") == named.strip("/")), None)
        if topic is None:
            raise InputError(f"{path}: has no topic {named!r}, which {setting} names; {found(listed)}")
        if topic.type not in types or not topic.messages:
            raise InputError(f"{path}: {setting}: found {shown(topic)}, expected messages of {expected}.")
        return topic
    fitting = [topic for topic in listed if topic.type in types and topic.messages]
    if len(fitting) > 1:
        choices = ", ".join(map(shown, fitting))
        raise InputError(f"{path}: has {choices}, expected {setting} to name the one to use.")
    return fitting[0] if fitting else None


def beside(name: str, other: str, known: Collection[str]) -> str | None:
    """The topic `other` in the folder of the topic `name`, or above: image_transport puts images a level deeper.

    None if there is none among the topics `known`.
    """
    parts = name.split("/")[:-1]
    candidates = ("/".join([*parts[:length], other]) for length in range(len(parts), 0, -1))
    return next((one for one in candidates if one in known), None)


def found(listed: Sequence[Topic]) -> str:
    """The topics of a bag, at the end of a message."""
    return f"found {', '.join(map(shown, listed))}."


def shown(topic: Topic) -> str:
    """A topic with its type and the number of its messages."""
    return f"{topic.name} ({plain(topic.type) or 'of several types'}, {topic.messages} messages)"


def plain(type_name: str) -> str:
    """The name of a type as in ROS 1."""
    return type_name.replace("/msg/", "/")
