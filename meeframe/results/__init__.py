"""Results: records, files, summaries and figures."""
