"""Connections to CAN interfaces."""
