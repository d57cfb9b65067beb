"""Figures and the self-contained report a person reads from top to bottom."""
