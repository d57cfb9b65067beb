"""A touch anywhere on the sheet: responses tabulated over place and force, and what several do to one another."""
