"""Parses names from the command line, `ekf,fastslam[particles=1000]`, into backends and datasets with options."""

import os
import re
import types
import typing
from collections.abc import Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, TypeVar

from ...backends import registry as backends
from ...backends.api import NoOptions
from ...backends.association import options as association
from ...core.csv_values import shortened
from ...core.errors import InputError, nearest
from ...core.options import parts
from ...datasets import registry as datasets
from ...datasets.bags.bag import is_bag
from ...datasets.formats import file_kind
from ..record import schema
from . import many
from .variant import LONGEST, PARTED, BackendVariant, DatasetVariant, Variant, text_of

V = TypeVar("V", bound=Variant)

_LETTERS = "ABC"


def backend_variants(text: str, asker: str = "--backend") -> list[BackendVariant]:
    """Finds the backends named in `text`; InputError names who asked, what is wrong, and the nearest right name."""
    found: list[BackendVariant] = []
    for name, given in _split(text, asker):
        if ":" in name and not _is_target(name):
            raise InputError(
                f"{asker}: found {name!r}, expected module:builder with the dotted name of a module, such as "
                "my_package.my_module:build, in this folder or on PYTHONPATH."
            )
        try:
            builder = backends.find_first(name)
        except KeyError:
            known = [*backends.BUILTIN, *backends.plugins()]
            hint = "A backend of your own is named my_package.my_module:build."
            raise InputError(f"{asker}: there is no backend {name!r}; {nearest(name, known)} {hint}") from None
        except backends.Missing as error:
            found.append(BackendVariant(name, NoOptions(), None, str(error)))
            continue
        where = f"backend {name}"
        if not builder.can_associate and any(option == "association" for option, _ in given):
            raise InputError(f"{where}: it does no data association; expected a backend that does, such as ekf.")
        options = read_options(builder.options, given, where)
        association.check(options, where)
        found.append(BackendVariant(name, options, builder))
    return _without_repeats(found, asker)


def _is_target(name: str) -> bool:
    """Tells if a name has the form module:builder."""
    module, _, builder = name.partition(":")
    return "/" not in name and not module.endswith(".py") and all((*module.split("."), builder))


def dataset_variants(text: str, asker: str = "--dataset") -> list[DatasetVariant]:
    """Finds the datasets named in `text`, or at the path of a log, graph or recording. InputError as above."""
    found: list[DatasetVariant] = []
    for name, given in _split_paths(text, asker):
        file = name.lower().endswith((*file_kind.SUFFIXES, many.FILE))
        if name not in datasets.BUILTIN and ("/" in name or file or os.path.exists(name) or many.is_pattern(name)):
            name, given = _kind(name), [("path", name), *given]  # noqa: PLW2901 - a path is short for log[path=...]
        try:
            source = datasets.find(name)
        except KeyError:
            hint = "Nor is there a log's folder, a graph's file or a recording at that path."
            raise InputError(
                f"{asker}: there is no dataset {name!r}; {nearest(name, datasets.BUILTIN)} {hint}"
            ) from None
        options = read_options(source.options, given, f"dataset {name}")
        _check_beside(source.options, given, f"dataset {name}")
        found.append(dataset_variant(name, options))
    return _without_repeats(found, asker)


def _split_paths(text: str, asker: str) -> list[tuple[str, list[tuple[str, str]]]]:
    """Parses names as `_split` does, but takes what is there by a name with brackets or commas for a path."""
    if _is_path(text):
        return [(text, [])]
    parts, found = pieces(text, asker), list[tuple[str, list[tuple[str, str]]]]()
    while parts:
        joined = next((k for k in range(len(parts), 0, -1) if _is_path(",".join(parts[:k]))), 0)
        found += [(",".join(parts[:joined]), [])] if joined else _split(parts[0], asker)
        parts = parts[joined or 1 :]
    return found


def _is_path(text: str) -> bool:
    """True for something that is there under a name with brackets or commas, which is not a dataset's with options."""
    odd = any(letter in text for letter in "[],")
    return odd and text.partition("[")[0] not in datasets.BUILTIN and os.path.exists(text)


def dataset_variant(name: str, options: Any) -> DatasetVariant:
    """Makes the variant of a known dataset, with its logs where the options stand for several; InputError as there."""
    source = datasets.find(name)
    if isinstance(options, datasets.Named) and options.name is not None:
        _check_name(options.name, f"dataset {name}")
    return DatasetVariant(name, options, source, many.members(name, options, source, dataset_variants))


def _check_name(name: str, where: str) -> None:
    """Refuses a name of a log that no table or file could have."""
    if not name.strip() or not name.isprintable() or len(name) > LONGEST:
        raise InputError(
            f"{where}: option name is {shortened(name)}, expected 1 to {LONGEST} characters that can be printed."
        )


def dataset_at(path: Path, asker: str, kind: str | None = None) -> DatasetVariant:
    """Finds the dataset that reads `path`, of that `kind` if it is yet to be written; InputError for a quote in it."""
    text = str(path)
    if '"' in text:
        raise InputError(f"{asker}: {path}: found a double quote in the path, expected one without.")
    kind = kind or _kind(text)
    source = datasets.find(kind)
    text = os.path.join(".", text) if text == "none" else text  # an option that is none is not given
    return dataset_variant(kind, source.options(path=text))


def _kind(path: str) -> str:
    """The dataset that reads a path, or all that fit a pattern; InputError where these are of several kinds.

    A laser log with a robot.toml beside it is a recording.
    """
    if many.is_pattern(path):
        kinds = {_kind(one): one for one in many.matches(path)}
        if len(kinds) > 1:
            said = " and ".join(f"{one}, {kind}" for kind, one in list(kinds.items())[:2])
            raise InputError(f"{path}: found datasets of several kinds, {said}; expected one, or a TOML file of them.")
        return next(iter(kinds))
    if path.lower().endswith(many.FILE) and not os.path.isdir(path):
        return many.LIST
    if path.lower().endswith(file_kind.SUFFIXES) and not os.path.isdir(path):
        return _or_recording(file_kind.format_of(Path(path)), path)
    if os.path.isfile(path) and file_kind.is_carmen(Path(path)):
        return _or_recording("carmen", path)
    if os.path.isfile(os.path.join(path, schema.FILE)) and not os.path.isfile(os.path.join(path, "log.toml")):
        raise InputError(
            f"{path}: found the folder of a run or a study, expected a log; `bench report {path}` writes its page "
            f"again, `bench replay {path}` shows it step by step."
        )
    inside = (os.path.join(path, name) for name in ("robot.toml", "metadata.yaml"))
    parts = os.path.isdir(path) and is_bag(Path(path))
    return "recording" if any(map(os.path.isfile, (path, *inside))) or parts else "log"


def _or_recording(kind: str, path: str) -> str:
    """The dataset that reads a file of that `kind`: of a laser log beside a robot.toml, a recording."""
    beside = os.path.join(os.path.dirname(path), "robot.toml")
    return "recording" if kind == "carmen" and os.path.isfile(beside) else kind


def read_options(cls: type[Any], given: Sequence[tuple[str, str]], where: str) -> Any:
    """Makes the options dataclass `cls`; InputError for a name=value that is unknown, unreadable or out of range."""
    return cls(**read_values(cls, given, where))


def read_values(cls: type[Any], given: Sequence[tuple[str, str]], where: str) -> dict[str, Any]:
    """Reads values of options of the dataclass `cls`, each by itself; InputError as in `read_options`."""
    known = {field.name: field for field in fields(cls)}
    values: dict[str, Any] = {}
    for name, text in given:
        if isinstance(text, _Listed) and name in known and not _is_list(known[name]):
            raise InputError(
                f"{where}: found {text.second!r}, expected option=value; option {name} is no list, and a value with a "
                "comma needs double quotes around it."
            )
        if name not in known:
            has = nearest(name, known)
            raise InputError(f"{where}: there is no option {name!r}; {has}")
        if name in values:
            raise InputError(f"{where}: option {name} is given twice, expected once.")
        values[name] = _read(known[name], typing.get_type_hints(cls)[name], text, where)
    return values


def _check_beside(cls: type[Any], given: Sequence[tuple[str, str]], where: str) -> None:
    """Refuses an option that has no effect without another one, or one of several, where none of them is given."""
    names = [name for name, _ in given]
    for field in fields(cls):
        beside = field.metadata.get("beside")
        others = (beside,) if isinstance(beside, str) else beside or ()
        if others and field.name in names and not set(others) & set(names):
            expected = "both" if len(others) == 1 else "one of them"
            said = f"option {field.name} has no effect without {' or '.join(others)}, expected {expected}."
            raise InputError(f"{where}: {said}")


def describe(cls: type[Any]) -> list[tuple[str, str, str]]:
    """Lists (name, default, summary with range or choices) of every option of a dataclass."""
    return [(field.name, text_of(field.default), _help(field)) for field in fields(cls)]


def _read(field: Field[Any], annotation: Any, text: str, where: str) -> Any:
    kinds = typing.get_args(annotation) if isinstance(annotation, types.UnionType) else (annotation,)
    if text == "none" and type(None) in kinds:
        return None
    if _several(kinds) and ("," in text or PARTED in text):
        return _parts(field, annotation, text, where)
    if (parted := field.metadata.get("parted")) is not None:
        text = parted.join(parts(text))  # as labels have it
    kind = next(k for k in kinds if k is not type(None))
    if str in kinds and text in (field.metadata.get("choices") or ()):
        return text
    if not text and kind is str and type(None) in kinds:
        raise InputError(f"{where}: option {field.name} is empty, expected {_expected(field, kind)}.")
    try:
        value = _KINDS[kind][0](text)
    except (KeyError, ValueError):
        raise InputError(
            f"{where}: option {field.name}={text}: found {text!r}, expected {_expected(field, kind)}."
        ) from None
    low, high, choices = (field.metadata.get(key) for key in ("minimum", "maximum", "choices"))
    outside = choices is not None and value not in choices
    if not isinstance(value, str):  # a number, for which `choices` are words in its place
        outside = value != value or (low is not None and value < low) or (high is not None and value > high)
    if outside:
        how = "is not one of its values" if isinstance(value, str) else "is out of range"
        raise InputError(f"{where}: option {field.name}={text} {how}; expected {_expected(field, kind)}.")
    return value


def _parts(field: Field[Any], annotation: Any, text: str, where: str) -> tuple[Any, ...]:
    """The values of an option that may have several numbers, parted by commas or semicolons."""
    count, values = _several(typing.get_args(annotation)), text.replace(PARTED, ",").split(",")
    if len(values) != count:
        kind = typing.get_args(annotation)[0]
        raise InputError(
            f"{where}: option {field.name}={text}: found {len(values)} values, expected {_expected(field, kind)}."
        )
    return tuple(_read(field, float, value.strip(), where) for value in values)


class _Listed(str):
    """A value of several pieces that were separated by commas, without quotes around them."""

    __slots__ = ("second",)
    second: str

    @classmethod
    def of(cls, text: str, piece: str) -> "_Listed":
        """`text` and one `piece` more."""
        made = cls(f"{text},{piece}")
        made.second = text.second if isinstance(text, _Listed) else piece
        return made


def _is_list(field: Field[Any]) -> bool:
    """True for an option that may have several values."""
    return field.metadata.get("parted") is not None or _several(typing.get_args(field.type)) > 0


def _several(kinds: Sequence[Any]) -> int:
    """The number of values that an option may have in place of one; 0 where it has one."""
    return next((len(typing.get_args(kind)) for kind in kinds if typing.get_origin(kind) is tuple), 0)


_KINDS: dict[Any, tuple[Any, str]] = {
    bool: (lambda text: {"true": True, "false": False}[text.lower()], "true or false"),
    int: (lambda text: int(text.replace("_", "")), "a whole number"),
    float: (float, "a number"),
    str: (str, "text"),
}


def _expected(field: Field[Any], kind: Any) -> str:
    several = _several(typing.get_args(field.type))
    return _one_expected(field, kind) + f", or {several} of them, {','.join(_LETTERS[:several])}" * (several > 0)


def _one_expected(field: Field[Any], kind: Any) -> str:
    low, high, choices = (field.metadata.get(key) for key in ("minimum", "maximum", "choices"))
    either = "one of " + ", ".join(choices or ())
    if choices and kind is str:
        return either
    words = f"{either}, or {_KINDS[kind][1]}" if choices else _KINDS[kind][1]
    if low is not None and high is not None:
        return f"{words} from {low} to {high}"
    if low is not None:
        return f"{words}, at least {low}"
    return f"{words}, at most {high}" if high is not None else words


def _help(field: Field[Any]) -> str:
    kinds = typing.get_args(field.type) or (field.type,)
    kind = next((k for k in kinds if k in _KINDS), str)
    expected = _expected(field, kind)
    return f"{field.metadata.get('summary', '')} ({expected})"


def _split(text: str, flag: str) -> list[tuple[str, list[tuple[str, str]]]]:
    """Parses `a,"b,c"[x=1,y="2,3"]` into [("a", []), ("b,c", [("x", "1"), ("y", "2,3")])]."""
    found: list[tuple[str, list[tuple[str, str]]]] = []
    for part in pieces(text, flag):
        quoted, rest = re.fullmatch(r'("[^"]*")?(.*)', part, re.DOTALL).groups("")  # pyright: ignore[reportOptionalMemberAccess]
        name, bracket, inside = rest.partition("[")
        if bracket and not inside.endswith("]"):
            raise InputError(f"{flag} {part}: expected the brackets to close at the end, as in name[option=value].")
        given: list[tuple[str, str]] = []
        for pair in pieces(inside[:-1], flag) if inside[:-1].strip() else []:
            option, equals, value = pair.partition("=")
            if not equals and given and pair:
                given[-1] = given[-1][0], _Listed.of(given[-1][1], _unquoted(pair, flag))
                continue
            if not equals:
                raise InputError(f"{flag} {part}: found {pair!r}, expected option=value.")
            given.append((option.strip(), _unquoted(value, flag)))
        name = _unquoted(quoted + name, flag)
        if not name:
            raise InputError(f"{flag} {text!r}: found an empty name, expected names separated by commas.")
        found.append((name, given))
    return found


def _unquoted(text: str, flag: str) -> str:
    """Strips space and double quotes around `text`; InputError for quotes within."""
    text = text.strip()
    bare = text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text
    if '"' in bare:
        raise InputError(f"{flag}: found {text}, expected double quotes around the whole of it or none.")
    return bare


def pieces(text: str, flag: str) -> list[str]:
    """Splits `text` at the commas that are neither in brackets nor in double quotes."""
    pieces, depth, quoted = [""], 0, False
    for c in text:
        quoted ^= c == '"'
        depth += 0 if quoted else (c == "[") - (c == "]")
        if c == "," and not depth and not quoted:
            pieces.append("")
        else:
            pieces[-1] += c
    if depth or quoted:
        raise InputError(f"{flag} {text}: expected every bracket and quote to be closed.")
    return [piece.strip() for piece in pieces]


def _without_repeats(found: list[V], flag: str) -> list[V]:
    seen: set[str] = set()
    for variant in found:
        if variant.label in seen:
            raise InputError(f"{flag}: {variant.label} is named twice, expected once.")
        seen.add(variant.label)
    return found
