"""The paper's own scheme: free three-row phi, one-pass training; chosen at start."""
