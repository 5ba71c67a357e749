"""Names and colours of several people, one after the other."""

COLOURS: tuple[tuple[int, int, int], ...] = (
    *((255, 200, 66), (220, 120, 230), (90, 210, 120)),
    *((90, 200, 255), (250, 110, 110), (200, 200, 200)),
)
"""RGB, of as many people as are followed at most."""


def person_names(count: int) -> list[str]:
    """Names of people, as of the folders of their results."""
    return [f"person_{k + 1}" for k in range(count)]
