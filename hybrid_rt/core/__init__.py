"""Shared by all packages: argument checks, hit records, threads, progress, the ledger of a render."""
