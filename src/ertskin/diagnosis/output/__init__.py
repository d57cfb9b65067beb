"""A diagnosis on the terminal, on disk and as a page."""
