"""From a received frame to the frames it causes."""
