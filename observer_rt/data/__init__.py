"""Package data: nominal injector, example bench, bus databases."""
