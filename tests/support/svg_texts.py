"""The texts of a picture, whose geometry depends on the fonts of a machine."""

import re
from html import unescape


def texts(svg: str) -> list[str]:
    """Every text, in the order that they were drawn."""
    return [unescape(text).strip() for text in re.findall(r"<text[^>]*>(.*?)</text>", svg, re.DOTALL)]
