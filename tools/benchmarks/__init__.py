"""What `tools/bench` measures: plants that know nothing of the package, cases, peers, scores."""
