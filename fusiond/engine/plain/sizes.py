"""What a plain step is told by its configuration, beside the sizes; `assembly` writes a configuration's own."""

RECURSION = "conventional"
TOPOLOGY = "centralized"
POLICY = "eigen_floor"
