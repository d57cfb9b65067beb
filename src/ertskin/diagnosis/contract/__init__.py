"""What a diagnosis says, and what it decides by."""
