"""Measurement Data Format 4: blocks and records, signals, and logs of CAN frames."""
