"""What speaks against an event, against what was learned, and its cause where one can be named."""
