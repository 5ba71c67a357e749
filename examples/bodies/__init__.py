"""Example bodies other than a person's, and recordings of their movements."""
