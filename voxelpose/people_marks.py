"""Names and colours of several people, one after the other, and names as pages show them."""


def rgb(code: str) -> tuple[int, int, int]:
    """Red, green and blue of a colour as pages write it, such as #ffc842."""
    red, green, blue = bytes.fromhex(code.removeprefix("#"))
    return red, green, blue


COLOURS = tuple(map(rgb, "#ffc842 #dc78e6 #5ad278 #5ac8ff #fa6e6e #c8c8c8".split()))
"""RGB, of as many people as are followed at most."""


def person_colour(number: int) -> tuple[int, int, int]:
    """Colour, RGB, of one of several people, counted from 0."""
    return COLOURS[number % len(COLOURS)]


def display_name(part: str) -> str:
    """Name of a part, joint or person with spaces."""
    return part.replace("_", " ")


def person_names(count: int) -> list[str]:
    """Names of people, as of the folders of their results."""
    return [f"person_{k + 1}" for k in range(count)]
