"""The catalogue of hard cases, one row each, run against independent truths."""
