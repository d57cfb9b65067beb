"""One figure per file; every function takes arrays and gives a matplotlib figure with units on its axes."""
