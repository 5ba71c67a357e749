"""What is made before anybody is tracked: library files, virtual takes, trained networks."""
