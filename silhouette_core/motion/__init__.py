"""Poses over time: kinematics and takes."""
