"""The injector's equations and how they are stepped."""
