"""Several people: where they are, whose pixels are whose, and each followed beside the others."""

import re
from typing import get_args

from calib.errors import InputError, check_name
from silhouette_core.estimator import KnownPerson
from silhouette_core.setting_types import Sex, Stature, checked

MOST_PEOPLE = 6
"""People that are looked for where their number is not told, and that may be told."""

_LONGEST_NAME = 40
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


def people_told(text: str, setting: str = "--persons {}") -> tuple[KnownPerson, ...]:
    """Several people as a setting tells of them, one after the other, with name, stature in metres
    and sex as far as they are known: Anna 1.68 female, Ben 1.82.

    Args:
        setting: how it is given, with {} in its place, for messages.

    Raises:
        InputError: a stature is none, or there are more people than are followed.
    """
    people = []
    for words_of in re.split("[,;]", text) if text.strip() else []:
        words, fault = words_of.split(), setting.format(words_of.strip()[:60])
        sexes: list[Sex] = [sex for w in words for sex in get_args(Sex) if w.lower() == sex]
        numbers = [word for word in words if word[0].isdigit()]
        name = " ".join(w for w in words if w.lower() not in sexes and w not in numbers)
        check_name(name)
        if max(len(sexes), len(numbers)) > 1 or len(name) > _LONGEST_NAME:
            raise InputError(
                f"{fault} is not one person: give a name, a stature in"
                " metres and a sex of each, with commas between people, as in Anna 1.68 female,"
                " Ben 1.82"
            )
        stature = checked(_number(numbers[0]), Stature, fault) if numbers else None
        people.append(KnownPerson(name, stature, *sexes))
    if len(people) > MOST_PEOPLE:
        raise InputError(f"{setting.format('')} tells of more than {MOST_PEOPLE} people")
    return tuple(people)


def _number(word: str) -> float | str:
    """The number that a word is, else the word."""
    try:
        return float(word.removesuffix("m"))
    except ValueError:
        return word


def require_cameras(people: int, cameras: int) -> None:
    """Raises InputError where so many cameras do not tell so many people apart."""
    if people > 1 and cameras < PEOPLE_CAMERAS:
        few = "1 camera is" if cameras == 1 else f"{cameras} cameras are"
        raise InputError(
            f"{few} too few to tell {people} people apart: give {PEOPLE_CAMERAS} or more, or"
            " --people 1"
        )
