"""Small random arguments for every kernel: one file per package, one function per kernel."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Example:
    """Arguments of a kernel and of its reference.

    Attributes:
        arguments: all arguments, arrays to be filled included.
        rtol: relative tolerance of the comparison.
        atol: absolute tolerance of the comparison.
    """

    arguments: tuple[Any, ...]
    rtol: float = 0.0
    atol: float = 0.0
