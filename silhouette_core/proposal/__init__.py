"""Learned proposal: probable poses of one person from the silhouettes of one camera."""
