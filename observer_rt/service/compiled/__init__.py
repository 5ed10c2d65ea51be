"""From one received frame to the rates it causes: compiled code, given all it works on by reference."""
