"""Contracts only: abstract classes and frozen records that every other room is written against."""
