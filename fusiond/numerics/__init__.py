"""Linear algebra and thresholds that know nothing of sensors: UD kernels, discretisation, covariance checks."""
