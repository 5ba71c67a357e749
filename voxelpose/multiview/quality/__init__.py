"""How good a fit is, and how far off it is to be expected."""
