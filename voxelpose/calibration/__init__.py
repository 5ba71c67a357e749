"""Calibration of lenses and poses from recordings, and the check and synchronisation of cameras."""
