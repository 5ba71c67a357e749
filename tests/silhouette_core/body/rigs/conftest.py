"""Small rigs of every format."""

import pytest


@pytest.fixture
def rig_files(beside):
    """The writers of small rigs, and `box_mesh`."""
    return beside("rig_fuzz_targets")
