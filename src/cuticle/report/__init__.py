"""Pages and pictures of what was fitted and of what an audit found."""
