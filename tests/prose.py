"""Sentences of the documentation's pages."""

import re
from collections.abc import Iterator

_FENCE = re.compile(r"^```.*?^```\s*?$", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_CODE = re.compile(r"`[^`\n]+`")
_IMAGE = re.compile(r"!\[([^\]]*)\]\([^)]*\)")
_LINK = re.compile(r"\[([^\]]+)\]\([^)]*\)")
_RULE = re.compile(r"^\|[\s:|-]+\|$")
_ITEM = re.compile(r"^(?:[-*+]|\d+\.)\s+")
# A full stop that ends no sentence: of an abbreviation, or of somebody's initial.
_SHORTENED = re.compile(
    r"\b(e\.g|i\.e|et al|etc|cf|vs|[Ff]igs?|[Ee]qs?|[Nn]o|approx|[A-Z])\.(?=\s)"
)
# Full stop, question or exclamation mark, what it closes, and a word that can begin a sentence.
_END = re.compile(r"(?<=[.!?])[\"'”’)*_]*\s+(?=[\"'“‘(*_]*[A-Z0-9])")


def sentences(text: str) -> list[str]:
    """Return the sentences of a page in Markdown, as they are read: code is one word, no links.

    Headings, list items and cells of tables end where they end, with or without a full stop;
    blocks of code are no sentences.
    """
    text = _COMMENT.sub("", _FENCE.sub("\n", text))
    text = _CODE.sub("Code", text)
    text = _LINK.sub(r"\1", _IMAGE.sub(r"\n\n\1\n\n", text))
    found = []
    for block in _blocks(text):
        block = _SHORTENED.sub(lambda match: match[1].replace(".", ""), block)
        found += [sentence for sentence in _END.split(block) if sentence.strip()]
    return found


def words(sentence: str) -> int:
    """Return how many words a sentence has: what holds a letter or a digit."""
    return sum(any(letter.isalnum() for letter in word) for word in sentence.split())


def _blocks(text: str) -> Iterator[str]:
    """Paragraphs, headings, list items and cells, each on one line."""
    lines: list[str] = []
    for line in [*text.splitlines(), ""]:
        line = line.strip()
        row, item = line.startswith("|"), _ITEM.match(line)
        if lines and (not line or row or item or line.startswith("#")):
            yield " ".join(lines)
            lines = []
        if row:
            yield from () if _RULE.match(line) else (cell.strip() for cell in line.split("|"))
        elif line.startswith("#"):
            yield line.lstrip("# ")
        elif line:
            lines.append(line[item.end() :] if item else line)
