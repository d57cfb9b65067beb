"""A tank or a sheet without mechanics."""
