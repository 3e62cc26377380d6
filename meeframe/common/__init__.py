"""Errors, memoization, threads and files that every room may use."""
