"""What the specimen of the fabric shows: a stress that is known."""
