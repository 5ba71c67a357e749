"""Compiled loops of retargeting."""
