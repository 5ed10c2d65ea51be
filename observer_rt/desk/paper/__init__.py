"""The paper's observer, its errata corrected: free three-row phi, one-pass identification, Figs. 3-5."""
