"""Other people's files as recordings: NPZ, MAT, CSV and EIDORS structures, by a mapping a person writes."""
