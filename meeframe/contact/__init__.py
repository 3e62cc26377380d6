"""Contact problems: unknowns, residual, scales and feasibility."""
