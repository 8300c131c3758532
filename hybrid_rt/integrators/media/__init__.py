"""Light within clear bodies: absorption, and bodies that touch."""
