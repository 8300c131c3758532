"""Participating dielectrics: absorption in them, and bodies that touch."""
