"""Pose library: poses seen from all sides, and a tree over their silhouettes."""
