"""What may be wrong with a reading or a sensor, and what that does to its health."""
