"""A person followed by refined hypotheses: from modes to a trajectory. Beyond paper A."""
