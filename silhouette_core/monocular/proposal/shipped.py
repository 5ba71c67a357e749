"""The proposal that comes with the program, for every person; `tools/proposal.py` learned it.

proposal.toml beside it states from what, and when. Weights have eight bits each and a scale per
unit: a file of 5 MB instead of 19.
"""

from functools import cache
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

from silhouette_core.monocular.proposal.pose_proposal import PoseProposal

FILE = Path(__file__).with_name("proposal.safetensors")
CARD = FILE.with_suffix(".toml")
_SCALE, _LARGEST = "scale of ", 127


def write_proposal(proposal: PoseProposal, path: Path) -> None:
    """Writes a proposal, with its weights rounded to eight bits."""
    arrays = {}
    for name, array in proposal.arrays().items():
        if "weight" in name:
            scale = np.maximum(np.abs(array).max(axis=0), np.finfo(np.float32).tiny) / _LARGEST
            arrays[_SCALE + name] = scale.astype(np.float32)
            array = np.rint(array / scale).astype(np.int8)
        arrays[name] = np.ascontiguousarray(array)
    save_file(arrays, path)


def read_proposal(path: Path) -> PoseProposal:
    """Proposal of a file that `write_proposal` made."""
    arrays = load_file(path)
    scales = {name: arrays.pop(_SCALE + name) for name in list(arrays) if _SCALE + name in arrays}
    return PoseProposal.from_arrays(
        arrays | {name: arrays[name] * scale for name, scale in scales.items()}
    )


@cache
def shipped_proposal() -> PoseProposal:
    """The proposal that comes with the program, read once."""
    return read_proposal(FILE)
