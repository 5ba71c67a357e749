"""What is made before anybody is tracked: pose libraries, virtual takes, trained networks."""
