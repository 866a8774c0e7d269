"""What a configuration chooses, beside the sizes; `assembly` writes a configuration's own."""

RECURSION = "conventional"
TOPOLOGY = "centralized"
POLICY = "eigen_floor"
