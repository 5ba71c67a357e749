"""What finds poses, in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

from voxelpose.live.remote_object import RemoteObject

if TYPE_CHECKING:
    from silhouette_core.body.model import BodyModel
    from voxelpose.live.live_estimators import FoundPose


class PoseFinder(Protocol):
    """Finds the person in one moment after the other."""

    def step(self, given: Any, /) -> FoundPose | None:
        """The person; None where there is none."""
        ...

    def close(self) -> None:
        """Ends what was begun."""
        ...


class EstimatorProcess:
    """A `PoseFinder` in another process.

    Args:
        make: makes it there; a function or class of a module.
        arguments: of `make`.

    Raises:
        InputError: as `make` raises it.
    """

    def __init__(self, make: Callable[..., PoseFinder], *arguments: object):
        """Begins the process, and waits until it is ready."""
        self._process = RemoteObject(_Sparing, make, arguments)
        self._model: BodyModel | None = None
        self._process.wait()

    def step(self, given: object) -> FoundPose | None:
        """See `PoseFinder.step`; what it raises there is raised here."""
        found = self._process.call("step", given)
        if found is None:
            return None
        self._model = found.model or self._model
        return replace(found, model=self._model)

    def close(self) -> None:
        """Ends the process."""
        self._process.close()


class _Sparing:
    """A `PoseFinder` whose body model, which is large, is sent only when it has changed."""

    def __init__(self, make: Callable[..., PoseFinder], arguments: tuple[object, ...]):
        self._finder = make(*arguments)
        self._sent: BodyModel | None = None

    def step(self, given: object) -> FoundPose | None:
        found = self._finder.step(given)
        if found is None:
            return None
        known, self._sent = found.model is self._sent, found.model
        return replace(found, model=None) if known else found  # type: ignore[arg-type]

    def close(self) -> None:
        self._finder.close()
