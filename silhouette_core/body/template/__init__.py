"""The template bodies, and the maker that models them from anthropometric measures (the maker needs
the `dev` extra).
"""
