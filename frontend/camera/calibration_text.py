"""Parses calibration files of any format: YAML, XML, JSON, sections as of .ini files, numpy's, and plain rows."""

import json
import re
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import YAMLError

from ...core.errors import InputError
from ...core.files import check_regular

LARGEST = 1_000_000  # bytes; a larger file is not a calibration

_NPY = b"\x93NUMPY"
"""The first bytes of numpy's file of one array."""

_SECTION = re.compile(r"\A(?:\s*(?:[#;].*|//.*)?\n)*\s*\[[^\[\],]+\]\s*(?:[#;].*|//.*)?$", re.MULTILINE)
"""The first line of a file with sections, after comments: [camera]."""


def contents(path: Path) -> dict[str, Any]:
    """Parses the file into texts, numbers, lists and mappings; a matrix is a mapping with rows, cols and data.

    InputError for what is not such a file.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"{path}: found {path.stat().st_size} bytes, expected a calibration of a few hundred")
        check_regular(path)
        if zipfile.is_zipfile(path):
            return _npz(path)
        if path.read_bytes()[: len(_NPY)] == _NPY:
            return _matrix(path, _npy(path))
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}; expected a calibration file") from None
    except ValueError:
        raise InputError(f"{path}: not a text file, expected a calibration file") from None
    rows = _rows(text)
    if rows is not None:
        return _matrix(path, rows)
    start = text.lstrip()
    kind = "XML" if start.startswith("<") else "JSON" if start.startswith("{") else "YAML"
    kind = "INI" if _SECTION.search(text) and kind == "YAML" else kind
    try:
        document = {"XML": _xml, "JSON": json.loads, "YAML": _yaml, "INI": _sections}[kind](text)
    except (YAMLError, ElementTree.ParseError, ValueError, RecursionError, TypeError) as error:
        mark = getattr(error, "problem_mark", None)
        line = getattr(error, "lineno", None) or getattr(error, "position", (None,))[0] or (mark and mark.line + 1)
        at = f", line {line}" if line else ""
        raise InputError(f"{path}{at}: not valid {kind}, expected a calibration file") from None
    if not isinstance(document, dict) or not document:
        raise InputError(f"{path}: found no keys, expected those of a calibration, such as camera_matrix")
    return {str(key): value for key, value in document.items()}


class _Constructor(SafeConstructor):
    """Constructs YAML's plain values, and OpenCV's matrices as mappings."""


for _tag in ("opencv-matrix", "opencv-nd-matrix"):
    _Constructor.add_constructor(
        f"tag:yaml.org,2002:{_tag}", lambda constructor, node: constructor.construct_mapping(node, deep=True)
    )


def _yaml(text: str) -> Any:
    yaml = YAML(typ="safe", pure=True)
    yaml.Constructor = _Constructor
    lines = text.split("\n")
    if lines[0].startswith("%YAML:"):  # OpenCV's own spelling of a directive
        lines[0] = ""
    return next(iter(yaml.load_all("\n".join(lines))), None)  # a printed message ends with a separator


def _xml(text: str) -> Any:
    def value(element: ElementTree.Element) -> Any:
        if len(element):
            return {child.tag: value(child) for child in element}
        words = (element.text or "").split()
        return words[0] if len(words) == 1 else words

    return value(ElementTree.fromstring(text))


def _sections(text: str) -> dict[str, Any]:
    """The sections of a file: `name = value`, or as in camera_calibration's ost.txt a name and values below it.

    Values are texts. A section that comes twice is of another camera.
    """
    found, key = dict[str, Any](), ""
    here = dict[str, str]()
    for line in text.split("\n"):
        words = re.split(r"//|[#;]", line, maxsplit=1)[0].strip()
        section = re.fullmatch(r"\[([^\[\]]*[^\[\]\d.\s,+-][^\[\]]*)\]", words)
        if section is not None:
            name = section[1].strip()
            here, key = found.setdefault(name if name not in found else f"{name} {len(found)}", {}), ""
        elif "=" in words:
            name, _, value = words.partition("=")
            here[name.strip().lower()], key = value.strip(), ""
        elif re.match(r"[A-Za-z]", words):
            key = words.lower()
            here[key] = ""
        elif key:
            here[key] = f"{here[key]} {words}".strip()
    return found


def _rows(text: str) -> list[list[float]] | None:
    """The rows of a text of several numbers alone, with blanks or commas between and # comments; None for others."""
    lines = [line.partition("#")[0].replace(",", " ").split() for line in text.split("\n")]
    try:
        rows = [[float(word) for word in words] for words in lines if words]
    except ValueError:
        return None
    return rows if sum(map(len, rows)) > 1 else None


def _npy(path: Path) -> list[Any]:
    """The rows of the array in numpy's file."""
    try:
        return np.atleast_2d(np.load(path, allow_pickle=False)).tolist()
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"{path}: not an array of numbers ({error}), expected a calibration file") from None


def _matrix(path: Path, rows: list[Any]) -> dict[str, Any]:
    """The entries of a file that has only a camera's matrix K, of a lens without distortion."""
    shape = np.shape(rows) if len({np.shape(row) for row in rows}) == 1 else ()
    if shape != (3, 3):
        found = " x ".join(map(str, shape)) or f"{len(rows)} uneven rows"
        raise InputError(f"{path}: found {found} of numbers, expected three rows of a matrix: fx 0 cx, 0 fy cy, 0 0 1")
    return {"camera_matrix": [number for row in rows for number in row]}


def _npz(path: Path) -> dict[str, Any]:
    """The arrays of numbers in numpy's file, as lists; others are passed over."""
    found = dict[str, Any]()
    try:
        with np.load(path, allow_pickle=False) as arrays:
            for name in arrays.files:
                try:
                    found[name] = arrays[name].tolist()
                except ValueError:  # of objects, such as the views' poses
                    continue
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a file of numpy's arrays ({error}), expected a calibration file") from None
    if not found:
        raise InputError(f"{path}: found no arrays of numbers, expected those of a calibration, such as mtx and dist")
    return found
