"""Seeded plants, sensors, and the ways in which they lie."""
