"""Networks from voltage changes to touches. One architecture a file; ``model=NAME`` chooses it."""
