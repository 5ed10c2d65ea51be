"""Reports of judged events and their injections, and their listeners."""
