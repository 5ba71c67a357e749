"""The engine of both estimators: candidates, the cheapest trajectory through them, its fit."""
