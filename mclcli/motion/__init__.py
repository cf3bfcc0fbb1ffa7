"""Motion models p(x_t | u_t, x_{t−1}): a file a model."""
