"""What a sensor's noise really is, estimated while it runs, inside guards."""
