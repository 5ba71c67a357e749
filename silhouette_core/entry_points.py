"""Classes registered by entry points, in this package or in others."""

from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

from calib.errors import InputError

T = TypeVar("T")


def registered(group: str) -> dict[str, EntryPoint]:
    """Returns the entry points of a group by name, without importing any."""
    return {point.name: point for point in entry_points(group=group)}


def load_registered(group: str, kind: str, protocol: type[T], name: str) -> T:
    """Imports a registered class and returns a new object of it. Raises InputError where none is
    registered under this name; TypeError where what is registered does not fulfil the protocol.

    Args:
        kind: What its classes are, for messages.
        protocol: Runtime-checkable protocol that they fulfil.
    """
    points = registered(group)
    if name not in points:
        raise InputError(
            f"no {kind} is called {name!r}: installed are {', '.join(sorted(points)) or 'none'}"
        )
    made = points[name].load()()
    if not isinstance(made, protocol):
        raise TypeError(
            f"{points[name].value} is registered as {kind} {name!r} but is not as"
            f" {protocol.__module__}.{protocol.__qualname__} describes"
        )
    return made
