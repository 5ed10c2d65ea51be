"""The paper's observer as published, errata mended: free three-row phi, one-pass identification, Figs. 3-5."""
