"""What a recording says, reduced for diagnosis, and which presses are kept for the proof."""
