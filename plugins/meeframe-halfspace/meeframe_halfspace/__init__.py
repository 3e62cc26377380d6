"""Half-space formulation of meeframe by fast Fourier transforms."""
