"""Files read as tables by a mapping, our own layout or one of the user's: columns to signals, on an even grid."""
