"""Many recordings at once: what is to be done, by whom, and the tables of what came of it."""
