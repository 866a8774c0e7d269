"""Process models and sensor models: f, h, their Jacobians, and named state slots with units."""
