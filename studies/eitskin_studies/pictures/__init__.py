"""Pictures of the results pages."""
