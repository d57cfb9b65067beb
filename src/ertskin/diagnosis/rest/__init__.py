"""What the frames at rest say, and the calibrated skin that every search starts from."""
