"""What ``import ertskin`` offers beside the types: one function a file."""
