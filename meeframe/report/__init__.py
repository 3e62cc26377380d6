"""Reports on a result: the summary and the figures. They see the result and nothing else."""
