"""The network that proposes poses, and its inference."""
