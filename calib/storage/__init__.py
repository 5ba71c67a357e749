"""Files and folders: read within bounds, written whole, locked; caches and scratch files."""
