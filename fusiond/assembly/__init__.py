"""From a configuration to an engine that runs: designs and compiled steps, cached by what they derive from."""
