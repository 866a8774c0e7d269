"""Commands from the estimate: control laws, saturation, safe states."""
