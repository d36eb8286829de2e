"""What an option of a dataset or a backend is, in the words of its help: the name of an axis over which it is swept."""

from dataclasses import fields
from typing import Any

import numpy as np

from ...backends import registry as backends
from ...datasets import registry as datasets
from ..record.cell_table import CellTable

LONGEST = 84
"""Letters that an axis has room for, in two lines."""


def option_words(parameter: str, table: CellTable) -> str:
    """With its unit, where somebody of the study has an option of that name and its help is short; else the name."""
    name = parameter.rpartition(".")[2]
    plain = name.replace("_", " ")
    having = np.flatnonzero(table.columns[parameter] != None)  # noqa: E711 - of each element
    if not len(having) or parameter in ("dataset", "backend", "seed"):
        return plain
    for column, registry in (("dataset", datasets), ("backend", backends)):
        summary = _summary(registry, str(table.columns[column][having[0]]).partition("[")[0], name)
        if summary and ":" not in summary:  # what stands after it tells the default, or one choice from another
            said = summary if plain in summary else f"{summary} ({plain})"
            return said if len(said) <= LONGEST else plain
    return plain


def _summary(registry: Any, who: str, name: str) -> str:
    """The first half of an option's help; "" where those that come along have no such one."""
    if who not in registry.BUILTIN:
        return ""
    options = {field.name: field for field in fields(registry.find(who).options)}
    return options[name].metadata["summary"].partition(";")[0] if name in options else ""
