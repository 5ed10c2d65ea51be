"""`tools/bench discovery`: effects hidden in recordings of independent plants, and whether `discover` names them."""
