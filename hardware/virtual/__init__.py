"""A rig that is not there: the simulated bench, and the instruments that stand before it."""
