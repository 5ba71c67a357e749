"""Several people: where they are, whose pixels are whose, and each followed beside the others."""

MOST_PEOPLE = 6
"""People that are looked for where their number is not told, and that may be told."""
