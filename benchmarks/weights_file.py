"""Files of weights, as `silhouette_core.fitted_weights` reads them, written by what fits them."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

_DECIMALS = 3


def write_weights(
    path: Path, fitted: Mapping[str, NDArray[np.floating]], data: str, command: str
) -> None:
    """Writes weights (n,) of some regressions, with today's date; those of others are kept.

    Args:
        path: the file.
        fitted: weights by the regression's name.
        data: the recordings that they were fitted to.
        command: the command that did so.
    """
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    for name, weights in fitted.items():
        document[name] = {
            "data": data,
            "command": command,
            "seed": "none: least squares and Newton's method begin with nothing random",
            "date": datetime.now(UTC).date().isoformat(),
            "weights": [round(float(weight), _DECIMALS) for weight in weights],
        }
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
