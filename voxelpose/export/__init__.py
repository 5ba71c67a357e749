"""File formats of results, each with its writer and, where one exists, its reader."""
