"""Several people: where they are, whose pixels are whose, and each followed beside the others."""

from calib.errors import InputError

MOST_PEOPLE = 6
"""People that are looked for where their number is not told, and that may be told."""

PEOPLE_CAMERAS = 3
"""Cameras that tell people apart, at least: before two, nearly everything is a phantom."""


def number_of_people(text: str, setting: str = "--people {}", *, auto: bool = True) -> int | None:
    """Number of people as a setting tells it; None: as many as are seen. Raises InputError where it
    is no number of people.

    Args:
        setting: how it is given, with {} in its place, for messages.
        auto: whether `auto` may be said.
    """
    if auto and text == "auto":
        return None
    if not text.isdecimal() or not 1 <= int(text) <= MOST_PEOPLE:
        raise InputError(
            f"{setting.format(text)} is no number of people that are followed: give 1 to"
            f" {MOST_PEOPLE}{', or auto' if auto else ''}"
        )
    return int(text)


def require_cameras(people: int, cameras: int) -> None:
    """Raises InputError where so many cameras do not tell so many people apart."""
    if people > 1 and cameras < PEOPLE_CAMERAS:
        few = "1 camera is" if cameras == 1 else f"{cameras} cameras are"
        raise InputError(
            f"{few} too few to tell {people} people apart: give {PEOPLE_CAMERAS} or more, or"
            " --people 1"
        )
