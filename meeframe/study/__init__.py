"""Studies: many runs of one case with some of its keys changed, and the figure that shows them."""
