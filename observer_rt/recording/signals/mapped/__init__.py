"""Files in a layout of the user's own: read as tables, their columns mapped to signals, put on an even grid."""
