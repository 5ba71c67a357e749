"""Motion: poses over time, kinematics and dynamics."""
