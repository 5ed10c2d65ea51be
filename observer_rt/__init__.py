"""Real-time neural-network observer of a common-rail injector's injection rate over CAN."""

__version__ = "0.1.0"
