"""`tools/bench discovery --outside`: effects no vocabulary has, and the terms `discover` proposes for them."""
