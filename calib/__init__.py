"""Cameras: how a point of the world becomes a pixel, and how that is measured. Knows nothing about
bodies.
"""
