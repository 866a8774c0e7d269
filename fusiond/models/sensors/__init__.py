"""Sensor models: what a reading says about the state."""
