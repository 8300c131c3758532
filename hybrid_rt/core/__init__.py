"""Shared by all packages: argument checks, hit records, threads, progress, a render's ledger."""
