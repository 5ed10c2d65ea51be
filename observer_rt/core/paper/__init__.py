"""The paper's own scheme."""
