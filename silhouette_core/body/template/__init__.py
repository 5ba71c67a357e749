"""Template bodies, and their generation from anthropometric measures (needs the `dev` extra)."""
