"""Pictures of what was fitted."""
