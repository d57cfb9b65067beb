"""Which effects a recording shows: terms screened, added, exchanged."""
