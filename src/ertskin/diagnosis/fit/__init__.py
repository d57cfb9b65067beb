"""Calibration and effects fitted together on every signal."""
