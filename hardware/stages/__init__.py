"""Stages: one controller one file."""
