"""Calibration from recordings of boards: which pictures serve, what comes out, and pictures of it."""
