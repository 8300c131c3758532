"""What the user describes, the flat tables that it becomes, and the plan of what it needs."""
