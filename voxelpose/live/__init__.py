"""Live estimation: cameras in, a moving figure out, at the cameras' rate."""
