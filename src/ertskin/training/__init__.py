"""Training: the loop, its checkpoints, and the way from trials to a reconstruction."""
