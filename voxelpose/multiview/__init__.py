"""Several calibrated cameras: from silhouettes to motion."""
