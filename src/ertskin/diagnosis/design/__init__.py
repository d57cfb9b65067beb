"""The presses that would tell rival explanations apart."""
