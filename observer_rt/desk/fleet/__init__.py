"""Many recordings through the observer on a cluster, an injection a row; wear of every injector over time."""
