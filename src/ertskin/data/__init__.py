"""Trials to learn from: what was pressed and what the electrodes would read."""
