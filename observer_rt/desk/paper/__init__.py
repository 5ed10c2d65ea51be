"""The paper's observer as published, with its errata corrected: free three-row phi, one-pass identification, Figs.
3-5."""
