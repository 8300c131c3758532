"""Its compiled loop."""
