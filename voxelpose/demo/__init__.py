"""Rendered recordings of a clothed mannequin, unlike the fitting body, in a small room."""
