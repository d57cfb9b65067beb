"""Load cells: one instrument one file."""
