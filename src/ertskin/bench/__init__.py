"""The bench from the command line: which rig, which plan, and what to show while it records."""
