"""Real instruments, the recording file they write, and the virtual rig."""
