"""The draft description that the project started from: its tables, functions, figures and claims."""
