"""Pump from the buses into the core and back onto them: who receives, hands over and sends."""
